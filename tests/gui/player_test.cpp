// Which frame comes next.
#include "gui/player.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <QSignalSpy>

namespace fathom::gui {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<int> ticks(Player& player, int count) {
  std::vector<int> shown;
  for (int i = 0; i < count; ++i) {
    player.tick();
    shown.push_back(player.frame());
  }
  return shown;
}

TEST(Player, LoopsOverTheFramesThereAre) {
  Player player;
  player.setFrames({1, 2, 5, 6}, 2);
  player.play();
  EXPECT_THAT(ticks(player, 5), ElementsAre(5, 6, 1, 2, 5));
  player.play(-1);
  EXPECT_THAT(ticks(player, 4), ElementsAre(2, 1, 6, 5));
}

TEST(Player, GoesThereAndBack) {
  Player player;
  player.setFrames({1, 2, 3}, 1);
  player.setRepeat(Repeat::PingPong);
  player.play();
  EXPECT_THAT(ticks(player, 6), ElementsAre(2, 3, 2, 1, 2, 3));
}

TEST(Player, StopsAtTheEndAndBeginsAgain) {
  Player player;
  player.setFrames({1, 2, 3}, 2);
  player.setRepeat(Repeat::Once);
  player.play();
  EXPECT_THAT(ticks(player, 2), ElementsAre(3, 3));
  EXPECT_FALSE(player.playing());
  player.play();
  EXPECT_TRUE(player.playing());
  EXPECT_EQ(player.frame(), 1);
  player.play(-1);
  EXPECT_EQ(player.frame(), 3);
}

TEST(Player, PlaysBetweenInAndOut) {
  Player player;
  player.setFrames({1, 2, 3, 4, 5, 6}, 1);
  player.setIn(3);
  player.setOut(5);
  player.play();
  EXPECT_THAT(ticks(player, 5), ElementsAre(3, 4, 5, 3, 4));
  player.setIn(6);
  EXPECT_EQ(player.out(), 6);
  player.clearRange();
  EXPECT_EQ(player.in(), 1);
}

TEST(Player, StepsWrapAndStopThePlaying) {
  Player player;
  player.setFrames({1, 2, 3}, 2);
  player.play();
  player.next();
  EXPECT_FALSE(player.playing());
  EXPECT_EQ(player.frame(), 3);
  player.next();
  EXPECT_EQ(player.frame(), 1);
  EXPECT_EQ(player.direction(), 1);
  player.previous();
  EXPECT_EQ(player.frame(), 3);
  EXPECT_EQ(player.direction(), -1);
  player.first();
  EXPECT_EQ(player.frame(), 1);
  player.last();
  EXPECT_EQ(player.frame(), 3);
}

TEST(Player, WaitsForAFrameThatIsNotReady) {
  Player player;
  player.setFrames({1, 2, 3}, 1);
  bool ready = false;
  player.setReady([&](int frame) { return frame != 2 || ready; });
  player.play();
  EXPECT_THAT(ticks(player, 2), ElementsAre(1, 1));
  EXPECT_TRUE(player.playing());
  ready = true;
  EXPECT_THAT(ticks(player, 2), ElementsAre(2, 3));
}

TEST(Player, KnowsWhatComes) {
  Player player;
  player.setFrames({1, 2, 3, 4, 5}, 4);
  EXPECT_THAT(player.ahead(10), ElementsAre(5, 1, 2, 3));
  EXPECT_THAT(player.ahead(2), ElementsAre(5, 1));
  player.setFrame(3);  // backwards
  EXPECT_THAT(player.ahead(10), ElementsAre(2, 1, 5, 4));
  player.setRepeat(Repeat::PingPong);
  EXPECT_THAT(player.ahead(10), ElementsAre(2, 1, 4, 5));
  player.setRepeat(Repeat::Once);
  EXPECT_THAT(player.ahead(10), ElementsAre(2, 1));
  player.setFrames({7}, 7);
  EXPECT_THAT(player.ahead(10), IsEmpty());
}

TEST(Player, TakesTheNearestFrameAndTellsOnce) {
  Player player;
  player.setFrames({10, 20, 30}, 22);
  QSignalSpy spy(&player, &Player::frameChanged);
  EXPECT_EQ(player.frame(), 20);
  player.setFrame(27);
  player.setFrame(1000);
  EXPECT_EQ(player.frame(), 30);
  EXPECT_EQ(spy.count(), 1);
  player.setFrame(-5);
  EXPECT_EQ(player.frame(), 10);
}

TEST(Player, OneFrameIsNotPlayed) {
  Player player;
  player.play();
  EXPECT_FALSE(player.playing());
  player.next();
  EXPECT_EQ(player.frame(), 0);
}

}  // namespace
}  // namespace fathom::gui
