// Which frame of a sequence is looked at, and which comes next; without pictures and without widgets.
#pragma once

#include <QObject>
#include <QTimer>
#include <functional>
#include <vector>

namespace fathom::gui {

enum class Repeat { Loop, PingPong, Once };

class Player : public QObject {
  Q_OBJECT

 public:
  explicit Player(QObject* parent = nullptr);

  // Ascending, at least one; holes are stepped over.
  const std::vector<int>& frames() const { return frames_; }
  int frame() const { return frame_; }
  // The first and last frame that are played.
  int in() const { return in_; }
  int out() const { return out_; }
  double fps() const { return fps_; }
  Repeat repeat() const { return repeat_; }
  bool playing() const { return timer_.isActive(); }
  // 1, or -1 where frames go backwards: of the last step, or of the playing.
  int direction() const { return direction_; }

  // Other frames: all are played, from the one nearest to `frame` on.
  void setFrames(std::vector<int> frames, int frame);
  // Playing waits for a frame that is not ready; without this, every frame is.
  void setReady(std::function<bool(int frame)> ready) { ready_ = std::move(ready); }
  // What playing shows after the current frame, nearest first: at most `count` different ones.
  std::vector<int> ahead(size_t count) const;
  // One step of the playing: to the next frame if it is ready, and to a stop where there is none.
  void tick();

  // The nearest frame there is, whether it is played or not.
  void setFrame(int frame);
  // Within what is played, from its ends to the other one; these stop the playing.
  void next();
  void previous();
  void first();
  void last();
  void play(int direction = 1);
  void stop();
  void toggle();
  // The current frame as the first or last that is played; where in > out, the other follows.
  void setInHere() { setIn(frame_); }
  void setOutHere() { setOut(frame_); }
  void setIn(int frame);
  void setOut(int frame);
  void clearRange();
  // Between 1 and 240.
  void setFps(double fps);
  void setRepeat(fathom::gui::Repeat repeat);

 signals:
  // Only on a change.
  void framesChanged();
  void frameChanged(int frame);
  void rangeChanged();
  void playingChanged(bool playing);
  void settingsChanged();  // fps, repeat

 private:
  struct Step {
    int frame;
    int direction;  // 0: there is no step
  };
  Step stepFrom(int frame, int direction) const;
  int nearest(int frame) const;
  void step(int direction);

  std::vector<int> frames_ = {0};
  int frame_ = 0, in_ = 0, out_ = 0;
  int direction_ = 1;
  double fps_ = 24;
  Repeat repeat_ = Repeat::Loop;
  std::function<bool(int)> ready_;
  QTimer timer_;
};

}  // namespace fathom::gui
