// The bytes of .tracks files (SQLite), read and written again.
#include "frontend/tracks/track_csv.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  const auto path = File("a.tracks", bytes);
  Try([&] {
    const TrackFile file = ReadTrackFile(path);
    WriteTrackFile(Folder() / "b.tracks", file);
    WriteTracksCsv(Folder() / "b.csv", file.tracks);
  });
}

}  // namespace cohort::fuzz
