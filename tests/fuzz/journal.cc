// What a killed run leaves: a .tracks file, and the journal or the log (its first byte tells) of SQLite beside it.
#include "frontend/tracks/track_store.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  const auto parts = Split(bytes, 2);
  const auto path = File("a.tracks", parts[0]);
  const auto witness = File("witness", "");
  for (const char* suffix : {"-wal", "-shm", "-journal"}) {
    std::filesystem::remove(path.string() + suffix);
  }
  if (!parts[1].empty()) {
    File(parts[1][0] == 'w' ? "a.tracks-wal" : "a.tracks-journal", parts[1].substr(1));
  }
  Try([&] { FindUnfinishedTracks(path); });
  Try([&] { ReadTrackFile(path); });
  if (!std::filesystem::exists(witness)) std::abort();  // what a journal would have deleted
}

}  // namespace cohort::fuzz
