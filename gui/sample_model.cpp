#include "gui/sample_model.h"

#include <QApplication>
#include <QPalette>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "cli/sample_report.h"

namespace fathom::gui {

namespace {

constexpr int kHighlightOpacity = 90;  // of 255

template <class T>
QString number(T value, bool full) {
  if (std::isnan(value)) return "nan";
  return QString::fromStdString(full ? fmt::format("{}", value) : fmt::format("{:.5g}", value));
}

// The value of a FLOAT or HALF channel, deep or flat; ids apart.
struct Cell {
  const uint32_t* id = nullptr;
  float value = NAN;
};

Cell cellOf(const PixelSamples& samples, const std::string& channel, int row) {
  const size_t i = samples.first + size_t(row);
  if (const flat::Image* image = samples.picture->flat()) return {nullptr, image->get(channel).values[i]};
  const deep::Channel& from = *samples.picture->deep()->find(channel);
  if (from.type == PixelType::Uint) return {&from.ids[i], 0};
  return {nullptr, from.values[i]};
}

// Names of channels may hold any bytes.
QString textOf(const nlohmann::json& json) {
  return QString::fromStdString(json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace

std::vector<SampleModel::Column> SampleModel::columnsOf(const Picture& picture) {
  std::vector<std::string> names, rest;
  if (const deep::DeepImage* image = picture.deep())
    for (const deep::Channel& channel : image->channels) rest.push_back(channel.name);
  if (const flat::Image* image = picture.flat())
    for (const flat::Plane& plane : image->planes) rest.push_back(plane.name);
  const auto take = [&](std::initializer_list<const char*> wanted) {
    for (const char* name : wanted)
      if (std::erase(rest, name) > 0) names.emplace_back(name);
  };
  std::vector<Column> columns;
  const auto flush = [&] {
    for (std::string& name : names) columns.push_back({Kind::Channel, std::move(name)});
    names.clear();
  };
  if (picture.deep()) columns.push_back({Kind::Number, "#"});
  if (!colourChannels(picture, "RGBA").empty()) columns.push_back({Kind::Colour, "colour"});
  take({"Z", "ZBack", "A"});
  flush();
  if (picture.deep()) columns.insert(columns.end(), {{Kind::Seen, "seen"}, {Kind::Front, "front"}});
  take({"R", "G", "B"});
  names.insert(names.end(), rest.begin(), rest.end());
  flush();
  return columns;
}

void SampleModel::show(PixelSamples samples) {
  const std::vector<Column> columns = samples.picture ? columnsOf(*samples.picture) : std::vector<Column>();
  highlight_ = -1;
  if (columns != columns_) {
    beginResetModel();
    columns_ = columns;
    samples_ = std::move(samples);
    endResetModel();
    return;
  }
  const int before = rowCount(), after = int(samples.samples.size());
  if (after > before) beginInsertRows({}, before, after - 1);
  if (after < before) beginRemoveRows({}, after, before - 1);
  samples_ = std::move(samples);
  if (after > before) endInsertRows();
  if (after < before) endRemoveRows();
  if (after > 0 && before > 0) emit dataChanged(index(0, 0), index(std::min(before, after) - 1, columnCount() - 1));
}

void SampleModel::setClip(const deep::DepthRange& clip) {
  if (clip == clip_) return;
  clip_ = clip;
  if (rowCount() > 0) emit dataChanged(index(0, 0), index(rowCount() - 1, columnCount() - 1), {Qt::ForegroundRole});
}

void SampleModel::setHighlight(int row) {
  const int before = std::exchange(highlight_, row);
  for (const int changed : {before, row})
    if (before != row && changed >= 0 && changed < rowCount())
      emit dataChanged(index(changed, 0), index(changed, columnCount() - 1), {Qt::BackgroundRole});
}

int SampleModel::rowCount(const QModelIndex& parent) const {
  return parent.isValid() ? 0 : int(samples_.samples.size());
}

int SampleModel::columnCount(const QModelIndex& parent) const {
  return parent.isValid() ? 0 : int(columns_.size());
}

QVariant SampleModel::data(const QModelIndex& index, int role) const {
  const Column& column = columns_[size_t(index.column())];
  const PixelSample& sample = samples_.samples[size_t(index.row())];
  switch (role) {
    case Qt::DisplayRole:
      return text(index.row(), column, false);
    case Qt::ToolTipRole:
      return text(index.row(), column, true);
    case Qt::DecorationRole:
      return column.kind == Kind::Colour ? QVariant(sample.colour) : QVariant();
    case Qt::TextAlignmentRole:
      return int(Qt::AlignRight | Qt::AlignVCenter);
    case kSortRole:
      return value(index.row(), column);
    case Qt::ForegroundRole:
      if (!samples_.isDeep() || deep::RangeCut(clip_).leavesAnything(sample.range)) return {};
      return QApplication::palette().color(QPalette::Disabled, QPalette::Text);
    case Qt::BackgroundRole: {
      if (index.row() != highlight_) return {};
      QColor colour = QApplication::palette().color(QPalette::Highlight);
      colour.setAlpha(kHighlightOpacity);
      return colour;
    }
    default:
      return {};
  }
}

QVariant SampleModel::headerData(int section, Qt::Orientation orientation, int role) const {
  if (orientation != Qt::Horizontal || section < 0 || section >= columnCount()) return {};
  if (role == Qt::DisplayRole) return columnName(section);
  if (role != Qt::ToolTipRole) return {};
  switch (columns_[size_t(section)].kind) {
    case Kind::Number:
      return tr("the sample's place in the file");
    case Kind::Seen:
      return tr("effective alpha: what the sample adds to the pixel's");
    case Kind::Front:
      return tr("transmittance of all that is in front of it");
    case Kind::Colour:
      return tr("colour of the sample itself, not premultiplied");
    case Kind::Channel:
      return columnName(section);
  }
  return {};
}

QString SampleModel::columnName(int column) const {
  return QString::fromStdString(printable(columns_[size_t(column)].name));
}

bool SampleModel::isUsual(int column) const {
  const std::string& name = columns_[size_t(column)].name;
  return !name.starts_with("half0.") && !name.starts_with("half1.") && !name.starts_with("variance.");
}

QString SampleModel::text(int row, const Column& column, bool full) const {
  const PixelSample& sample = samples_.samples[size_t(row)];
  switch (column.kind) {
    case Kind::Number:
      return QString::number(row);
    case Kind::Seen:
      return samples_.problem.isEmpty() ? number(sample.seen, full) : QString();
    case Kind::Front:
      return samples_.problem.isEmpty() ? number(sample.front, full) : QString();
    case Kind::Colour:
      return full ? sample.colour.name() : QString();
    case Kind::Channel:
      break;
  }
  const Cell cell = cellOf(samples_, column.name, row);
  return cell.id ? QString::number(*cell.id) : number(cell.value, full);
}

double SampleModel::value(int row, const Column& column) const {
  const PixelSample& sample = samples_.samples[size_t(row)];
  switch (column.kind) {
    case Kind::Number:
      return row;
    case Kind::Seen:
      return sample.seen;
    case Kind::Front:
      return sample.front;
    case Kind::Colour:
      return double(sample.colour.lightnessF());
    case Kind::Channel:
      break;
  }
  const Cell cell = cellOf(samples_, column.name, row);
  return cell.id ? double(*cell.id) : double(cell.value);
}

QString SampleModel::tsv(const std::vector<int>& rows, const std::vector<int>& columns) const {
  QStringList lines, cells;
  const auto line = [&](const auto& cell) {
    cells.clear();
    for (const int column : columns)
      if (columns_[size_t(column)].kind != Kind::Colour) cells << cell(column);
    lines << cells.join('\t');
  };
  line([&](int column) { return columnName(column); });
  for (const int row : rows) line([&](int column) { return text(row, columns_[size_t(column)], true); });
  return lines.join('\n') + '\n';
}

QString SampleModel::json(const std::vector<int>& rows) const {
  using nlohmann::json;
  if (!samples_.picture) return {};
  const int x = samples_.pixel.x(), y = samples_.pixel.y();
  if (const deep::DeepImage* image = samples_.picture->deep()) {
    json all = cli::sampleJson(*image, x, y), chosen = json::array();
    for (const int row : rows) chosen.push_back(all["samples"][size_t(row)]);
    all["samples"] = chosen;
    return textOf(all);
  }
  json channels = json::object();
  for (const Column& column : columns_) {
    if (column.kind != Kind::Channel || rows.empty()) continue;
    channels[column.name] = cli::valueJson(cellOf(samples_, column.name, 0).value);
  }
  return textOf({{"x", x}, {"y", y}, {"channels", channels}});
}

bool SampleOrder::lessThan(const QModelIndex& left, const QModelIndex& right) const {
  const double a = left.data(SampleModel::kSortRole).toDouble(), b = right.data(SampleModel::kSortRole).toDouble();
  if (std::isnan(a) || std::isnan(b)) return !std::isnan(a) && std::isnan(b);
  return a < b;
}

}  // namespace fathom::gui
