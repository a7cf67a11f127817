#include "backend/colmap/colmap_tracks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>
#include <vector>

namespace cohort {
namespace {

// The keypoints of all images, numbered consecutively. Keypoints at the same position of an image
// are represented by the first of them.
class Nodes {
 public:
  Nodes(const ColmapDatabase& database, const std::filesystem::path& path) {
    for (const auto& [id, image] : database.images) {
      const std::size_t first = image_of_.size();
      first_of_image_[id] = first;
      std::map<std::pair<float, float>, std::size_t> at_position;
      for (const Eigen::Vector2f& xy : image.keypoints) {
        if (!xy.allFinite()) {
          ThrowError("COLMAP database {}: keypoint {} of image {} is not finite",
                     path.string(),
                     image_of_.size() - first,
                     image.name);
        }
        same_.push_back(
            at_position.emplace(std::pair(xy.x(), xy.y()), image_of_.size()).first->second);
        image_of_.push_back(id);
      }
    }
  }

  std::size_t size() const { return image_of_.size(); }
  std::size_t Of(ColmapImageId image, std::uint32_t keypoint) const {
    return same_[first_of_image_.at(image) + keypoint];
  }
  ColmapImageId ImageOf(std::size_t node) const { return image_of_[node]; }
  std::uint32_t KeypointOf(std::size_t node) const {
    return static_cast<std::uint32_t>(node - first_of_image_.at(image_of_[node]));
  }

 private:
  std::map<ColmapImageId, std::size_t> first_of_image_;
  std::vector<ColmapImageId> image_of_;
  std::vector<std::size_t> same_;
};

// Disjoint sets of nodes, with at most one node per image in a set.
class Components {
 public:
  explicit Components(const Nodes& nodes) : parent_(nodes.size()), images_(nodes.size()) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (std::size_t n = 0; n < nodes.size(); ++n) images_[n] = {nodes.ImageOf(n)};
  }

  std::size_t Root(std::size_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  // Returns false if an image would have two nodes.
  bool Join(std::size_t a, std::size_t b) {
    a = Root(a);
    b = Root(b);
    if (a == b) return true;
    // Sets only grow, so a refused join stays impossible; a file may request it many times.
    if (refused_.contains(std::minmax(a, b))) return false;
    if (images_[a].size() < images_[b].size()) std::swap(a, b);
    std::vector<ColmapImageId>& many = images_[a];
    const std::vector<ColmapImageId>& few = images_[b];
    const bool fits = std::none_of(few.begin(), few.end(), [&many](ColmapImageId image) {
      return std::binary_search(many.begin(), many.end(), image);
    });
    if (!fits) {
      refused_.insert(std::minmax(a, b));
      return false;
    }
    for (const ColmapImageId image : few) {
      many.insert(std::lower_bound(many.begin(), many.end(), image), image);
    }
    parent_[b] = a;
    images_[b] = {};
    return true;
  }
  std::size_t Size(std::size_t root) const { return images_[root].size(); }

 private:
  std::vector<std::size_t> parent_;
  std::vector<std::vector<ColmapImageId>> images_;         // by root, ascending
  std::set<std::pair<std::size_t, std::size_t>> refused_;  // roots, the smaller first
};

}  // namespace

ImportedTracks TracksOfColmapDatabase(const ColmapDatabase& database,
                                      std::span<const FrameInfo> frames,
                                      const std::filesystem::path& path) {
  using Pair = std::tuple<std::size_t, ColmapImageId, ColmapImageId>;
  std::vector<Pair> pairs;  // with most inliers first
  for (const auto& [ids, pair] : database.pairs) {
    if (!pair.geometry || pair.geometry->inliers.empty()) continue;
    pairs.emplace_back(pair.geometry->inliers.size(), ids.first, ids.second);
  }
  if (pairs.empty()) {
    ThrowError(
        "COLMAP database {} has no verified matches (two_view_geometries): match its images with "
        "colmap first",
        path.string());
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tuple(std::get<0>(b), std::get<1>(a), std::get<2>(a)) <
           std::tuple(std::get<0>(a), std::get<1>(b), std::get<2>(b));
  });

  ImportedTracks result;
  result.camera = FromColmapCamera(database.camera);
  // COLMAP also marks a focal length from EXIF as a prior, but then refines it.
  if (IsFoundByColmap(database.camera.model) || IsStartOfColmap(database.camera)) {
    result.camera->known = false;
  }
  const Nodes nodes(database, path);
  Components components(nodes);
  for (const auto& [count, image1, image2] : pairs) {
    for (const auto& [index1, index2] : database.pairs.at({image1, image2}).geometry->inliers) {
      if (!components.Join(nodes.Of(image1, index1), nodes.Of(image2, index2))) ++result.left_out;
    }
  }

  FrameNames names(frames);
  std::map<ColmapImageId, std::optional<FrameIndex>> frame_of_image;
  for (const auto& [id, image] : database.images) {
    frame_of_image[id] = names.Find(image.name);
    if (frame_of_image[id] || image.keypoints.empty()) continue;
    if (result.unknown_images++ == 0) result.an_unknown_image = image.name;
  }
  std::vector<Observation> observations;
  std::map<std::size_t, FeatureId> feature_of_root;
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    const std::size_t root = components.Root(node);
    const auto frame = frame_of_image.at(nodes.ImageOf(node));
    if (!frame || components.Size(root) < 2) continue;
    const auto next = FeatureId{static_cast<std::uint32_t>(feature_of_root.size())};
    const FeatureId feature = feature_of_root.emplace(root, next).first->second;
    const Eigen::Vector2f& xy =
        database.images.at(nodes.ImageOf(node)).keypoints[nodes.KeypointOf(node)];
    observations.push_back(
        {.feature = feature,
         .frame = *frame,
         .xy = xy.cast<double>() - Eigen::Vector2d::Constant(kColmapPixelShift)});
  }
  result.tracks = TrackSet::Build(std::move(observations));
  CheckSomeImageKnown(result, path.string(), frames);
  return result;
}

std::map<std::uint64_t, FeatureId> FeaturesOfColmapPoints(const ColmapModel& model) {
  std::map<std::uint64_t, FeatureId> features;
  if (model.points.empty()) return features;
  constexpr std::uint64_t kIds = std::uint64_t{1} << 32;
  const bool keeps_ids = model.points.begin()->first > 0 && model.points.rbegin()->first <= kIds;
  for (const auto& [id, point] : model.points) {
    const std::uint64_t number = keeps_ids ? id - 1 : features.size();
    features.emplace_hint(features.end(), id, FeatureId{static_cast<std::uint32_t>(number)});
  }
  return features;
}

ImportedTracks TracksOfColmapModel(const ColmapModel& model,
                                   std::span<const FrameInfo> frames,
                                   const std::filesystem::path& path) {
  ImportedTracks result;
  for (const auto& [id, image] : model.images) {
    if (!model.cameras.contains(image.camera_id)) {
      ThrowError("COLMAP model {}: image {} refers to camera {}, which does not exist",
                 path.string(),
                 image.name,
                 image.camera_id);
    }
  }
  if (model.images.empty() || model.points.empty()) {
    ThrowError("COLMAP model {} has {} images and {} points: there are no tracks",
               path.string(),
               model.images.size(),
               model.points.size());
  }
  const SharedCamera shared = ShareCamera(model);
  if (shared.other) {
    ThrowError(
        "COLMAP model {}: the camera of image {} differs from that of other images in more than "
        "the focal length: give a model of a clip with one camera (colmap feature_extractor "
        "--ImageReader.single_camera 1)",
        path.string(),
        model.images.at(*shared.other).name);
  }
  result.camera = shared.camera;
  // A camera whose focal length changes counts as a guess.
  result.camera->known = shared.focal_scale.empty();

  FrameNames names(frames);
  std::map<ColmapImageId, std::optional<FrameIndex>> frame_of_image;
  for (const auto& [id, image] : model.images) {
    frame_of_image[id] = names.Find(image.name);
    if (frame_of_image[id]) continue;
    if (result.unknown_images++ == 0) result.an_unknown_image = image.name;
  }
  const std::map<std::uint64_t, FeatureId> features = FeaturesOfColmapPoints(model);
  std::vector<Observation> observations;
  for (const auto& [id, point] : model.points) {
    const FeatureId feature = features.at(id);
    std::set<FrameIndex> seen_in;
    for (const auto& [image_id, index] : point.track) {
      const auto image = model.images.find(image_id);
      if (image == model.images.end() || index >= image->second.points2d.size()) {
        ThrowError(
            "COLMAP model {}: point {} is observed in image {} at index {}, which does not exist",
            path.string(),
            id,
            image_id,
            index);
      }
      const Eigen::Vector2d& xy = image->second.points2d[index].xy;
      if (!xy.allFinite()) {
        ThrowError("COLMAP model {}: position {} of image {} is not finite",
                   path.string(),
                   index,
                   image->second.name);
      }
      const auto frame = frame_of_image.at(image_id);
      if (!frame) continue;
      if (!seen_in.insert(*frame).second) {
        ++result.left_out;
        continue;
      }
      observations.push_back({.feature = feature,
                              .frame = *frame,
                              .xy = xy - Eigen::Vector2d::Constant(kColmapPixelShift)});
    }
  }
  result.tracks = TrackSet::Build(std::move(observations));
  CheckSomeImageKnown(result, path.string(), frames);
  if (result.tracks.observations().empty()) {
    ThrowError(
        "COLMAP model {}: none of its {} points is observed in an image: there are no tracks",
        path.string(),
        model.points.size());
  }
  return result;
}

}  // namespace cohort
