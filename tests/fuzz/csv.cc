// CSV of tracks.
#include "frontend/tracks/track_csv.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] { ReadTracksCsv(File("a.csv", bytes)); });
}

}  // namespace cohort::fuzz
