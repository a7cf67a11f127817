// What a killed run leaves: a .tracks file, and SQLite's journal or log beside it (its first byte
// tells).
#include <ctime>

#include "frontend/tracks/track_store.h"
#include "tests/fuzz/target.h"

// A reader waits 30 ms for a journal that does not fit, as its writer may be about to end. Here is
// none, and four fifths of the time would go by asleep.
extern "C" int nanosleep(const timespec* time, timespec* /*left*/) {
  return time->tv_sec == 0 ? 0 : clock_nanosleep(CLOCK_MONOTONIC, 0, time, nullptr);
}

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
