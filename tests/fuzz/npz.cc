// NumPy archives of tracks.
#include "frontend/tracks/track_npz.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  const auto path = File("a.npz", bytes);
  for (const NpzLayout layout : {NpzLayout::kAuto, NpzLayout::kTracksFirst}) {
    Try([&] { ReadTracksNpz(path, Frames(), kWidthPx, kHeightPx, {.layout = layout}); });
  }
}

}  // namespace cohort::fuzz
