#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/readers/sequence.h"
#include "datasets/render/synthetic_scene.h"

namespace cohort::test {

inline constexpr int kWidth = 64;
inline constexpr int kHeight = 48;

// An 8-bit grey image of one value, 64x48. Makes the folders above it.
void WriteImage(const std::filesystem::path& file, int value, cv::Size size = {kWidth, kHeight});

void WriteText(const std::filesystem::path& file, const std::string& text);

// Keeps the first `fraction` of a file's bytes.
void CutFile(const std::filesystem::path& file, double fraction);

// What RenderSequence writes, but with a picture that does not show the scene: much faster.
void WriteSceneWithoutPictures(const SyntheticSceneOptions& options,
                               const std::filesystem::path& folder);

std::vector<Frame> ReadAll(Sequence& sequence);
std::vector<std::string> Names(const std::vector<Frame>& frames);
std::vector<std::uint32_t> Indices(const std::vector<Frame>& frames);

}  // namespace cohort::test
