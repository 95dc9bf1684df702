// The samples of one pixel as a table: number, colour, depths, alpha, what is seen, and every other channel.
#pragma once

#include <QAbstractTableModel>
#include <QSortFilterProxyModel>
#include <vector>

#include "deep/depth_range.h"
#include "gui/pixel_samples.h"

namespace fathom::gui {

class SampleModel : public QAbstractTableModel {
  Q_OBJECT

 public:
  // The value to sort by: a double.
  static constexpr int kSortRole = Qt::UserRole;

  using QAbstractTableModel::QAbstractTableModel;

  // Columns stay as long as the picture has the same channels. A flat picture's pixel is one row of its channels.
  void show(PixelSamples samples);
  const PixelSamples& samples() const { return samples_; }
  // Rows outside of it are greyed.
  void setClip(const deep::DepthRange& clip);
  // A row that stands out; -1: none.
  void setHighlight(int row);

  int rowCount(const QModelIndex& parent = {}) const override;
  int columnCount(const QModelIndex& parent = {}) const override;
  QVariant data(const QModelIndex& index, int role) const override;
  QVariant headerData(int section, Qt::Orientation orientation, int role) const override;

  QString columnName(int column) const;
  // False for what the denoiser knows of a sample, and few others ask for: half buffers, variances.
  bool isUsual(int column) const;

  // Names in the first line, then a line for each row; values with all digits that they have, colours left out.
  QString tsv(const std::vector<int>& rows, const std::vector<int>& columns) const;
  // As cli::sampleJson, with these samples alone; of a flat picture {x, y, channels}. Throws Error where there is no
  // channel A or Z.
  QString json(const std::vector<int>& rows) const;

 private:
  enum class Kind { Number, Channel, Seen, Front, Colour };
  struct Column {
    Kind kind;
    std::string name;
    bool operator==(const Column&) const = default;
  };
  static std::vector<Column> columnsOf(const Picture& picture);
  QString text(int row, const Column& column, bool full) const;
  double value(int row, const Column& column) const;

  PixelSamples samples_;
  std::vector<Column> columns_;
  deep::DepthRange clip_;
  int highlight_ = -1;
};

// Sorts by values; what is no number comes last.
class SampleOrder : public QSortFilterProxyModel {
 public:
  using QSortFilterProxyModel::QSortFilterProxyModel;

 protected:
  bool lessThan(const QModelIndex& left, const QModelIndex& right) const override;
};

}  // namespace fathom::gui
