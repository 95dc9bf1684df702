// A volume, or any deep image, that is placed in A, and in B where that is deep: moved and scaled while one looks. While it
// moves the screen shows a draft, which costs what is seen of it; once it rests, its samples go among all others.
#pragma once

#include <QObject>
#include <QString>
#include <QTimer>
#include <memory>
#include <optional>
#include <string>

#include "deep/ops/transform.h"
#include "gui/background.h"
#include "gui/frames.h"

namespace fathom::gui {

// Between which depths the samples of A and of the volume lie as they were read; finite ones.
struct PlacedDepths {
  float nearest = 0, farthest = 0;              // of A
  float volumeNearest = 0, volumeFarthest = 0;  // of the volume
  bool operator==(const PlacedDepths&) const = default;
};

class Placement : public QObject {
  Q_OBJECT

 public:
  Placement(Session& session, Frames& frames, QObject* parent = nullptr);
  ~Placement() override;

  bool active() const { return volume_.has_value(); }
  // The file that is placed in the current frame; empty: none. Of a sequence, the one of A's frame or the nearest.
  std::string file() const;
  const deep::Transform& transform() const { return transform_; }
  const PlacedDepths& depths() const { return depths_; }
  // Until all samples are where they belong.
  bool busy() const { return background_.busy() || rest_.isActive(); }

  // A file or a pattern; takes the place of the one before. From now on A and B are shown with it.
  void open(const QString& path);
  // Shows A and B as they are again.
  void remove();
  void setTransform(const fathom::deep::Transform& transform);

 signals:
  // Another volume, or none, or it was moved.
  void changed();
  // Another range of depths is known.
  void depthsChanged();

 private:
  // What was read last, kept for the next move.
  struct Read {
    std::string path;
    PicturePtr picture;
    PicturePtr a;  // what `depths` are of, beside the volume
    PlacedDepths depths;
  };
  void draft();
  void place();
  void delivered(const PlacedDepths& depths);
  static const deep::DeepImage& volumeOf(Read& read, const std::string& path, const PicturePtr& a, size_t memory,
                                         const Progress& progress);

  Session& session_;
  Frames& frames_;
  std::optional<Source> volume_;
  deep::Transform transform_;
  PlacedDepths depths_;
  PicturePtr a_, b_;            // as they were read
  std::shared_ptr<Read> read_;  // touched by the work in the background only
  bool whole_ = false;          // what runs puts all samples together, and takes its time
  QTimer rest_;                 // what is left of the moment without a move after which that begins
  Background background_;
};

}  // namespace fathom::gui
