// tracks.csv of OpenSfM.
#include "frontend/tracks/opensfm_tracks.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] { ReadOpenSfmTracks(File("tracks.csv", bytes), Frames(), kWidthPx, kHeightPx); });
}

}  // namespace cohort::fuzz
