#include "pipelines/jobs/track_doubts.h"

#include <spdlog/spdlog.h>

#include <filesystem>

#include "datasets/open_sequence.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/input.h"

namespace cohort {

void WarnOf(const std::string& doubt) {
  if (!doubt.empty()) spdlog::warn("{}", doubt);
}

void WarnIfClipChanged(const TrackFile& file, const std::string& tracks, const Sequence& clip) {
  WarnOf(DoubtOfClip(file, tracks, clip));
}

void WarnIfVideoChanged(const TrackFile& file, const std::string& tracks) {
  if (!file.image_root.empty() || !std::filesystem::exists(file.source)) return;
  WarnIfClipChanged(file, tracks, *OpenSequence(file.source));
}

void WarnIfModelOfOthers(const Reconstruction& model,
                         const std::string& folder,
                         const TrackFile& file,
                         const std::string& tracks) {
  WarnOf(DoubtOfModel(model, folder, file, tracks));
}

void WarnIfSceneDiffers(const SecondPassFigures& figures) { WarnOf(DoubtOfMeasuring(figures)); }

void WarnIfCameraDoubtful(const std::optional<Camera>& camera) {
  if (camera) WarnOf(DoubtOfCamera(*camera));
}

void TellFocalGuess(const TrackFile& file) {
  const std::string guess = DescribeFocalGuess(file);
  if (!guess.empty()) spdlog::info("{}", guess);
}

}  // namespace cohort
