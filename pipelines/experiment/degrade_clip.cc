#include "pipelines/experiment/degrade_clip.h"

#include <spdlog/spdlog.h>

#include "pipelines/console/progress_bar.h"

namespace cohort {

void DegradeClip(const DegradeClipOptions& options) {
  const DegradeOptions defaults;
  if (options.degrade.recipe != DegradeRecipe::kPhone &&
      (options.degrade.codec != defaults.codec ||
       options.degrade.bitrate_kbit != defaults.bitrate_kbit)) {
    ThrowUsageError("--codec and --bitrate-kbit are for --recipe phone: leave them out with {}",
                    NameOf(kRecipeNames, options.degrade.recipe));
  }
  if (options.degrade.recipe == DegradeRecipe::kPaper && options.degrade.light != defaults.light) {
    ThrowUsageError("--light is for the recipes sensor and phone: leave it out with {}",
                    NameOf(kRecipeNames, options.degrade.recipe));
  }
  DegradeOptions degrade = options.degrade;
  degrade.level = ParseLevel(options.level);
  const auto sequence = OpenInput(options.input);
  // Its size is not needed, so no picture is read for it.
  const std::optional<Camera> camera = KnownCamera(options.input, *sequence, 0, 0);
  ProgressBar progress("degrade", sequence->FrameCount());
  DegradeSequence(
      *sequence, options.input.input, camera, degrade, options.out, [&](std::size_t, std::size_t) {
        progress.Advance();
      });
  if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
}

}  // namespace cohort
