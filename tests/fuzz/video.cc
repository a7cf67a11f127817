// Headers of videos: what FFmpeg makes of them is checked by us. The first three frames.
#include "datasets/readers/video_sequence.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] {
    const auto video = OpenVideo(File("a.video", bytes), {.end = 3});
    while (video->Next()) {
    }
    video->FrameCount();
  });
}

}  // namespace cohort::fuzz
