// The bytes of COLMAP databases (SQLite).
#include "backend/colmap/colmap_tracks.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  const auto path = File("a.db", bytes);
  for (const char* suffix : {"-wal", "-shm", "-journal"}) {
    std::filesystem::remove(path.string() + suffix);
  }
  Try([&] { TracksOfColmapDatabase(ReadColmapDatabase(path), Frames(), path); });
}

}  // namespace cohort::fuzz
