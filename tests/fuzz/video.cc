// Headers of videos: what FFmpeg makes of them is checked by us, and what a GoPro writes is read by
// us. The first three frames.
#include "datasets/readers/gopro_metadata.h"
#include "datasets/readers/video_sequence.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] {
    const auto file = File("a.video", bytes);
    ReadGoProView(file);
    const auto video = OpenVideo(file, {.end = 3});
    while (video->Next()) {
    }
    video->FrameCount();
  });
}

}  // namespace cohort::fuzz
