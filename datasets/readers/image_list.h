#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "datasets/readers/sequence.h"
#include "frontend/core/time_difference.h"

namespace cohort {

// A sequence as a list of image files with the data of its layout. Every layout but video is read
// into one of these, so that all share the decoding frame by frame.
struct ImageList {
  struct Image {
    std::string name;  // relative to the root
    std::int64_t timestamp_ns = 0;
  };

  std::string name;
  std::filesystem::path root;
  std::vector<Image> images;     // image i is frame i
  std::filesystem::path times;   // the file with their times; empty if there is none
  std::optional<Camera> camera;  // a size of 0 is filled in from the first image
  std::map<FrameIndex, Rigid3> cam_from_world;
  std::map<FrameIndex, std::filesystem::path> depth_files;  // 16 bits, 1/5000 m; 0: unknown
  std::map<FrameIndex, std::filesystem::path> occluder_files;
};

inline constexpr std::uint64_t kMaxTimeDifferenceNs = 20'000'000;

// The value with the nearest time stamp [ns] for every image, unless it is over 20 ms away.
template <typename T>
std::map<FrameIndex, T> ByNearestTime(const std::vector<ImageList::Image>& images,
                                      const std::map<std::int64_t, T>& by_time) {
  std::map<FrameIndex, T> by_frame;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const std::int64_t time = images[i].timestamp_ns;
    const auto distance = [&](auto it) { return TimeBetween(it->first, time); };
    auto nearest = by_time.lower_bound(time);
    if (nearest != by_time.begin() &&
        (nearest == by_time.end() || distance(std::prev(nearest)) <= distance(nearest))) {
      --nearest;
    }
    if (nearest != by_time.end() && distance(nearest) <= kMaxTimeDifferenceNs) {
      by_frame.emplace(FrameIndex(i), nearest->second);
    }
  }
  return by_frame;
}

// The last component of a folder's path, also of "." and "clip/".
std::string FolderName(const std::filesystem::path& folder);

// Throws Error if the first image of the range cannot be decoded or the range starts after the last
// image.
std::unique_ptr<Sequence> OpenImageList(ImageList list, const FrameRange& range);

}  // namespace cohort
