#include "pipelines/sfm/refine_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>
#include <set>
#include <vector>

#include "backend/colmap/camera_model.h"
#include "frontend/core/random_stream.h"
#include "frontend/geometry/sim3.h"
#include "tests/support/plane_clip.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::ThrowsMessage;

constexpr int kFrames = 16;  // of the clip

// A COLMAP model of the planes whose keypoints are a pixel off, whose cameras are shaken, and whose
// ids, names and world are nobody's but its own: image 100 - i is frame i.
class RefineModelOfPlanes : public testing::Test {
 protected:
  RefineModelOfPlanes() : clip_(kFrames) {
    Camera camera = clip_.scene().camera();
    model_.cameras[7] = ToColmapCamera(camera);
    for (int i = 0; i < kFrames; ++i) {
      ColmapModelImage& image = model_.images[static_cast<ColmapImageId>(100 - i)];
      image.camera_id = 7;
      image.name = "some/folder/" + std::to_string(i) + ".png";
      Rigid3 pose = TransformPose(world_from_truth_, test::PlaneScene::CamFromWorld(i));
      for (int axis = 0; axis < 3; ++axis) pose.translation[axis] += 0.02 * noise_.Gaussian();
      image.cam_from_world = pose;
    }
    std::uint64_t id = 500;
    for (int y = 30; y < 220; y += 14) {
      for (int x = 30; x < 300; x += 14) AddPoint(id += 3, Eigen::Vector2d(x, y));
    }
  }

  // With `in_front`, a point that is nowhere: so much nearer than what the pictures show.
  void AddPoint(std::uint64_t id, const Eigen::Vector2d& xy, double in_front = 1.0) {
    const Rigid3 middle = test::PlaneScene::CamFromWorld(kFrames / 2);
    auto seen = clip_.scene().PointAt(middle, xy);
    if (!seen) return;
    seen = middle.Inverse() * (in_front * (middle * *seen)).eval();
    ColmapPoint3D point;
    point.xyz = world_from_truth_ * *seen;
    point.rgb = {static_cast<std::uint8_t>(id % 256), 20, 30};
    for (int i = 0; i < kFrames; ++i) {
      const Rigid3 pose = test::PlaneScene::CamFromWorld(i);
      const auto at = clip_.scene().camera().Project(pose * *seen);
      if (!at || !clip_.scene().camera().Contains(*at, 10.0)) continue;
      if (in_front == 1.0 && !clip_.scene().IsVisible(pose, *seen)) continue;
      auto& image = model_.images.at(static_cast<ColmapImageId>(100 - i));
      point.track.emplace_back(100 - i, static_cast<std::uint32_t>(image.points2d.size()));
      const Eigen::Vector2d off(noise_.Gaussian(), noise_.Gaussian());
      image.points2d.push_back({*at + off + Eigen::Vector2d::Constant(kColmapPixelShift), id});
    }
    if (point.track.size() < 3) return;
    model_.points[id] = point;
    in_middle_[id] = xy;
  }

  // Whose patches show nothing that is nearer or further.
  std::set<std::uint64_t> PointsOfOneSurface() const {
    const Rigid3 middle = test::PlaneScene::CamFromWorld(kFrames / 2);
    const auto depth = [&](const Eigen::Vector2d& xy) {
      return (middle * *clip_.scene().PointAt(middle, xy)).z();
    };
    std::set<std::uint64_t> ids;
    for (const auto& [id, xy] : in_middle_) {
      const Eigen::Vector2d half(20.0, 0.0);
      const bool flat = std::abs(depth(xy - half) - depth(xy)) < 0.1 &&
                        std::abs(depth(xy + half) - depth(xy)) < 0.1;
      if (id < 5000 && flat) ids.insert(id);
    }
    return ids;
  }

  // Root mean square distance of the cameras from where they are in the model's own world.
  double CameraError(const ColmapModel& model) const {
    double sum = 0.0;
    for (const auto& [id, image] : model.images) {
      const Rigid3 truth = TransformPose(
          world_from_truth_, test::PlaneScene::CamFromWorld(100 - static_cast<int>(id)));
      sum +=
          (image.cam_from_world.Inverse().translation - truth.Inverse().translation).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(model.images.size()));
  }

  test::PlaneClip clip_;
  RandomStream noise_{1, "refine_model_test"};
  const Sim3 world_from_truth_{
      2.0,
      Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d(1.0, 2.0, 3.0).normalized())),
      {10.0, -20.0, 30.0}};
  ColmapModel model_;
  std::map<std::uint64_t, Eigen::Vector2d> in_middle_;  // where its points are in the middle frame
};

TEST_F(RefineModelOfPlanes, CamerasGetNearerToTheTruthAndAllElseStaysAndIsTheSameTwice) {
  const RefinedModel refined = RefineModel(model_, "sparse", clip_, {});
  EXPECT_LT(CameraError(refined.model), 0.3 * CameraError(model_))
      << "in the world that came in, not one of its own";
  EXPECT_EQ(refined.model.cameras, model_.cameras) << "a PINHOLE is a calibration";
  EXPECT_THAT(refined.notes, IsEmpty());
  ASSERT_THAT(refined.model.images, SizeIs(kFrames));
  for (const auto& [id, image] : refined.model.images) {
    EXPECT_EQ(image.name, model_.images.at(id).name);
  }
  EXPECT_GT(refined.model.points.size() + refined.contradicted, model_.points.size() * 9 / 10);
  for (const auto& [id, point] : refined.model.points) {
    ASSERT_TRUE(model_.points.contains(id));
    EXPECT_EQ(point.rgb, model_.points.at(id).rgb);
    for (const auto& [image, index] : point.track) {
      EXPECT_EQ(refined.model.images.at(image).points2d.at(index).point3d, id);
    }
  }
  EXPECT_EQ(refined.adjusted.ceres->camera_covariances.size(), static_cast<std::size_t>(kFrames));
  EXPECT_GT(refined.found.Confirmed(), 0.8);

  const RefinedModel again = RefineModel(model_, "sparse", clip_, {});
  ASSERT_EQ(again.model.points.size(), refined.model.points.size());
  for (const auto& [id, point] : refined.model.points) {
    EXPECT_EQ(point.xyz, again.model.points.at(id).xyz) << "the same twice is the same";
  }
}

// As georeferencing gives them.
TEST_F(RefineModelOfPlanes, AModelFarFromTheOriginIsRefinedAsWellAndStaysThere) {
  const Sim3 far{1.0, Eigen::Quaterniond::Identity(), {4e6, 8e5, 3.6e6}};
  ColmapModel there = model_;
  for (auto& [id, image] : there.images) {
    image.cam_from_world = TransformPose(far, image.cam_from_world);
  }
  for (auto& [id, point] : there.points) point.xyz = far * point.xyz;
  const RefinedModel near = RefineModel(model_, "sparse", clip_, {});
  RefinedModel refined = RefineModel(there, "sparse", clip_, {});
  EXPECT_NEAR(static_cast<double>(refined.model.points.size()),
              static_cast<double>(near.model.points.size()),
              2.0);
  for (auto& [id, image] : refined.model.images) {
    image.cam_from_world = TransformPose(far.Inverse(), image.cam_from_world);
  }
  EXPECT_LT(CameraError(refined.model), 0.3 * CameraError(model_));
}

TEST_F(RefineModelOfPlanes, ACameraThatColmapFoundIsRefinedAndKeepsItsModel) {
  ColmapCamera guess = model_.cameras.at(7);
  guess.model = ColmapCameraModel::kSimplePinhole;
  guess.params.erase(guess.params.begin());
  const double truth = guess.params[0];
  guess.params[0] *= 1.02;
  model_.cameras.at(7) = guess;
  const RefinedModel refined = RefineModel(model_, "sparse", clip_, {});
  EXPECT_TRUE(refined.camera_refined);
  const ColmapCamera& after = refined.model.cameras.at(7);
  EXPECT_EQ(after.model, ColmapCameraModel::kSimplePinhole);
  EXPECT_LT(std::abs(after.params[0] - truth), 0.5 * std::abs(guess.params[0] - truth));

  RefineModelOptions keep;
  keep.intrinsics = IntrinsicsMode::kKeep;
  const RefinedModel kept = RefineModel(model_, "sparse", clip_, keep);
  EXPECT_FALSE(kept.camera_refined);
  EXPECT_EQ(kept.model.cameras.at(7), guess);
}

TEST_F(RefineModelOfPlanes, AModelOfTwoImagesIsRefused) {
  ColmapModel two = model_;
  std::erase_if(two.images, [](const auto& image) { return image.first < 99; });
  for (auto& [id, point] : two.points) {
    std::erase_if(point.track, [](const auto& view) { return view.first < 99; });
  }
  std::erase_if(two.points, [](const auto& point) { return point.second.track.size() < 2; });
  for (auto& [id, image] : two.images) {
    for (ColmapPoint2D& at : image.points2d) {
      if (at.point3d && !two.points.contains(*at.point3d)) at.point3d.reset();
    }
  }
  EXPECT_THAT(
      [&] { RefineModel(two, "sparse/0", clip_, {}); },
      ThrowsMessage<Error>(AllOf(
          HasSubstr("sparse/0: no point of its "),
          HasSubstr("survives the adjustment of its 2 images: give COLMAP's largest model"))));
}

// As those of pictures that ffmpeg writes, beside a video's, which are named from 0.
TEST_F(RefineModelOfPlanes, NamesThatCountFromOneAreRefused) {
  // Points that a detector chose; those of the grid lie anywhere.
  model_.points.clear();
  for (auto& [id, image] : model_.images) {
    image.points2d.clear();
    image.cam_from_world = TransformPose(
        world_from_truth_, test::PlaneScene::CamFromWorld(100 - static_cast<int>(id)));
  }
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(clip_.Picture(kFrames / 2), corners, 150, 0.01, 8.0);
  std::uint64_t id = 500;
  for (const cv::Point2f& corner : corners) AddPoint(++id, Eigen::Vector2d(corner.x, corner.y));
  EXPECT_NO_THROW(RefineModel(model_, "sparse", clip_));
  for (auto& [image_id, image] : model_.images)
    image.name = std::to_string(101 - image_id) + ".png";
  EXPECT_THAT([&] { RefineModel(model_, "sparse", clip_); },
              ThrowsMessage<Error>(AllOf(HasSubstr("its image 2.png is not the frame of that name"),
                                         HasSubstr("but frame 1"),
                                         HasSubstr("counts from 1"))));
}

TEST_F(RefineModelOfPlanes, OtherPicturesAreRefused) {
  test::PlaneClip other(kFrames);
  for (int i = 0; i < kFrames; ++i) {
    const test::PlaneScene scene;
    // Elsewhere in each frame.
    scene.Render(test::PlaneScene::CamFromWorld(37 * (i + 1)))
        .convertTo(other.Picture(i), CV_8U, 255.0);
  }
  EXPECT_THAT([&] { RefineModel(model_, "sparse", other, {}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("sparse: only "),
                                         HasSubstr("points look alike in the frames of planes"))));
}

TEST_F(RefineModelOfPlanes, ImagesThatAreNoFrameAreLeftOutAndSaid) {
  test::PlaneClip shorter(kFrames - 3);
  const RefinedModel refined = RefineModel(model_, "sparse", shorter, {});
  EXPECT_THAT(refined.model.images, SizeIs(kFrames - 3));
  EXPECT_THAT(refined.notes, ElementsAre(HasSubstr("3 of its images are not frames of planes")));
}

TEST_F(RefineModelOfPlanes, PointsThatThePicturesContradictAreDropped) {
  std::set<std::uint64_t> wrong;
  for (std::uint64_t id = 5000; id < 5008; ++id) {
    const auto i = static_cast<double>(id - 5000);
    AddPoint(id, {110.0 + 14.0 * i, 120.0}, 0.3);
    ASSERT_TRUE(model_.points.contains(id));
    wrong.insert(id);
  }
  const std::set<std::uint64_t> flat = PointsOfOneSurface();
  const auto count_wrong = [&](const ColmapModel& model) {
    return std::count_if(
        wrong.begin(), wrong.end(), [&](std::uint64_t id) { return model.points.contains(id); });
  };
  const RefinedModel refined = RefineModel(model_, "sparse", clip_, {});
  EXPECT_GE(refined.contradicted, wrong.size() - 1);
  EXPECT_LE(count_wrong(refined.model), 1) << "one may look alike by chance";
  const auto stay = std::count_if(flat.begin(), flat.end(), [&](std::uint64_t id) {
    return refined.model.points.contains(id);
  });
  EXPECT_GT(flat.size(), 60U);
  EXPECT_GT(stay, flat.size() * 95 / 100) << "points whose patches show one surface";

  RefineModelOptions keep;
  keep.drop_contradicted = false;
  const RefinedModel kept = RefineModel(model_, "sparse", clip_, keep);
  EXPECT_EQ(kept.contradicted, 0U);
  EXPECT_GT(count_wrong(kept.model), count_wrong(refined.model));
}

TEST_F(RefineModelOfPlanes, AFrameWithFewPointsKeepsThemAll) {
  std::erase_if(model_.points, [](const auto& point) { return point.first % 11 != 0; });
  AddPoint(5000, {130.0, 120.0}, 0.3);
  ASSERT_LT(model_.points.size(), 30U);
  const RefinedModel refined = RefineModel(model_, "sparse", clip_, {});
  EXPECT_EQ(refined.contradicted, 0U);
  EXPECT_THAT(refined.model.images, SizeIs(kFrames));
}

TEST(InWorldOf, CamerasOnALineKeepTheirTurn) {
  Reconstruction world;
  for (std::uint32_t i = 0; i < 4; ++i) {
    world.cam_from_world[FrameIndex{i}].translation = Eigen::Vector3d(-1.0 * i, 0.0, 0.0);
  }
  world.points[FeatureId{1}].in_world = {1.0, 2.0, 3.0};
  const Sim3 moved{
      3.0, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX())), {5.0, 6.0, 7.0}};
  MapperResult model;
  model.reconstruction = world;
  for (auto& [frame, pose] : model.reconstruction.cam_from_world) pose = TransformPose(moved, pose);
  Eigen::Vector3d& point = model.reconstruction.points[FeatureId{1}].in_world;
  point = moved * point;
  // Deviations of a tenth of a unit of this world, along its first axis.
  model.point_covariances[FeatureId{1}] = Eigen::Vector3d(0.01, 0.0, 0.0).asDiagonal();
  const MapperResult back = InWorldOf(world, model);
  EXPECT_LT(
      (back.reconstruction.points.at(FeatureId{1}).in_world - Eigen::Vector3d(1, 2, 3)).norm(),
      1e-9);
  EXPECT_LT(
      (back.reconstruction.cam_from_world.at(FrameIndex{3}).translation + Eigen::Vector3d(3, 0, 0))
          .norm(),
      1e-9);
  EXPECT_NEAR(back.point_covariances.at(FeatureId{1})(0, 0), 0.01 / 9.0, 1e-9);
}

}  // namespace
}  // namespace cohort
