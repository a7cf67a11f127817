#include <gtest/gtest.h>

#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"

namespace cohort {
namespace {

TEST(ProgressLine, TellsShareSpeedAndTimeLeft) {
  EXPECT_EQ(ProgressLine("track", 30, 120, 10.0, "fps"),
            "track [=======                       ] 30/120  3.0 fps  ETA 0:30");
  EXPECT_EQ(ProgressLine("track", 120, 120, 40.0, "fps"),
            "track [==============================] 120/120  3.0 fps  ETA 0:00");
  EXPECT_EQ(ProgressLine("cells", 1, 4000, 1.0, ""),
            "cells [                              ] 1/4000  ETA 66:39");
  EXPECT_EQ(ProgressLine("cells", 0, 4, 1.0, ""), "cells [                              ] 0/4");
}

TEST(ProgressLine, CountsWhereTheTotalIsUnknownOrWasAGuess) {
  EXPECT_EQ(ProgressLine("track", 30, std::nullopt, 10.0, "fps"), "track 30  3.0 fps");
  EXPECT_EQ(ProgressLine("track", 6, 5, 2.0, "fps"),
            "track [==============================] 6/5  3.0 fps  ETA 0:00");
}

TEST(AlignedTable, AlignsColumnsUnderARule) {
  EXPECT_EQ(
      AlignedTable({{"tracker", "level", "error"}, {"klt", "medium", "12.5"}, {"subspace"}}, 2),
      "tracker   level   error\n"
      "-----------------------\n"
      "klt       medium   12.5\n"
      "subspace\n");
  EXPECT_EQ(AlignedTable({}), "");
}

TEST(AlignedTable, GoesOnBelowWhereItIsTooWide) {
  EXPECT_EQ(
      AlignedTable({{"tracker", "error", "length", "seconds"}, {"klt", "1", "23", "4"}}, 1, 22),
      "tracker  error  length\n"
      "----------------------\n"
      "klt          1      23\n"
      "\n"
      "tracker  seconds\n"
      "----------------\n"
      "klt            4\n");
}

}  // namespace
}  // namespace cohort
