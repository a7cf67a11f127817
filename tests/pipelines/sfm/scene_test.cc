#include "pipelines/sfm/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "backend/colmap/model_io.h"
#include "backend/scene/phrasebook.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/film_advice.h"
#include "tests/support/picture_clip.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

std::vector<SceneCandidate> Path(int frames, double motion) {
  std::vector<SceneCandidate> path;
  for (int i = 0; i < frames; ++i) {
    path.push_back({FrameIndex(i), i == 0 ? 0.0 : motion, i % 5 == 3 ? 2.0 : 1.0});
  }
  return path;
}

TEST(ChooseImages, TakesTheSharpestFrameOfEveryPieceOfThePath) {
  const auto chosen = ChooseImages(Path(500, 0.002), {.max_images = 300, .min_motion = 0.01});
  ASSERT_THAT(chosen, SizeIs(99)) << "500 frames of 0.2 % of the diagonal, a picture every 1 %";
  int sharp = 0;
  for (const FrameIndex frame : chosen) sharp += ToInt(frame) % 5 == 3 ? 1 : 0;
  EXPECT_GT(sharp, 95);
}

TEST(ChooseImages, TakesNoMoreThanAsked) {
  EXPECT_THAT(ChooseImages(Path(500, 0.1), {.max_images = 40}), SizeIs(40));
  EXPECT_THAT(ChooseImages(Path(500, 0.1), {.max_images = 1000}), SizeIs(500));
}

TEST(ChooseImages, OfACameraThatStandsStillTakesFramesByTime) {
  const auto chosen = ChooseImages(Path(100, 0.0), {.max_images = 10});
  ASSERT_THAT(chosen, SizeIs(10));
  EXPECT_LT(ToInt(chosen.front()), 10u);
  EXPECT_GE(ToInt(chosen.back()), 90u);
}

TEST(ChooseImages, OfALongClipTakesAllFramesThatAreAskedFor) {
  EXPECT_THAT(ChooseImages(Path(9000, 0.0), {.max_images = 10000, .min_motion = 0.0}),
              SizeIs(9000));
}

TEST(ChooseImages, TakesMoreWhereTheCameraMovesFaster) {
  std::vector<SceneCandidate> path = Path(200, 0.001);
  for (int i = 100; i < 200; ++i) path[i].motion = 0.01;
  const auto chosen = ChooseImages(path, {.max_images = 60});
  int fast = 0;
  for (const FrameIndex frame : chosen) fast += ToInt(frame) >= 100 ? 1 : 0;
  EXPECT_GT(fast, 45);
}

TEST(ChooseImages, OfOneFrameOrNoneTakesWhatThereIs) {
  EXPECT_THAT(ChooseImages({}, {}), IsEmpty());
  EXPECT_THAT(ChooseImages(Path(1, 0.0), {}), ElementsAre(FrameIndex{0}));
}

Camera Lens(double k1, CameraModel model = CameraModel::kPinhole) {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx = camera.fy = 500.0;
  camera.cx = 322.0;
  camera.cy = 236.0;
  camera.k1 = k1;
  camera.model = model;
  return camera;
}

class Undistorted : public testing::TestWithParam<Camera> {};

TEST_P(Undistorted, HasNoBlankBorderAndWastesLittle) {
  const Camera& lens = GetParam();
  const Camera pinhole = UndistortedCamera(lens);
  EXPECT_EQ(pinhole.fx, pinhole.fy);
  EXPECT_FALSE(pinhole.HasDistortion());
  EXPECT_EQ(pinhole.cx, (lens.width_px - 1) / 2.0);
  double nearest_px = 1e9;
  for (int y = 0; y < lens.height_px; ++y) {
    const bool whole_row = y == 0 || y == lens.height_px - 1;
    for (int x = 0; x < lens.width_px; x += whole_row ? 1 : lens.width_px - 1) {
      const auto xy =
          lens.Project({(x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy, 1.0});
      ASSERT_TRUE(xy && lens.Contains(*xy, -0.1)) << x << " " << y;
      nearest_px = std::min({nearest_px,
                             xy->x(),
                             lens.width_px - 1 - xy->x(),
                             xy->y(),
                             lens.height_px - 1 - xy->y()});
    }
  }
  EXPECT_LT(nearest_px, 2.0) << "it could see more";
}

constexpr const char* kLenses[] = {"Pinhole", "Barrel", "Pincushion", "Fisheye"};
INSTANTIATE_TEST_SUITE_P(
    OfEveryLens,
    Undistorted,
    testing::Values(Lens(0.0), Lens(-0.25), Lens(0.15), Lens(-0.01, CameraModel::kFisheye)),
    [](const auto& lens) { return kLenses[lens.index]; });

TEST(UndistortedCamera, OfAPinholeInTheMiddleIsTheSame) {
  Camera camera = Camera::Guess(640, 480);
  EXPECT_EQ(UndistortedCamera(camera).fx, camera.fx);
}

TEST(SceneFromModel, StandsUprightAroundTheCameras) {
  Reconstruction model;
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  for (std::uint32_t i = 0; i < 5; ++i) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitY()));
    model.cam_from_world[FrameIndex{i}] = {turn * tilt, Eigen::Vector3d(1.0 * i, 2.0, 3.0)};
  }
  const Rigid3 scene_from_model = SceneFromModel(model);
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto& [frame, cam_from_world] : model.cam_from_world) {
    const Rigid3 scene_from_cam = scene_from_model * cam_from_world.Inverse();
    EXPECT_NEAR((scene_from_cam.rotation * -Eigen::Vector3d::UnitY()).z(), 1.0, 1e-9);
    center += scene_from_cam.translation;
  }
  EXPECT_LT(center.norm(), 1e-9);
}

TEST(ToneCurve, SpreadsWhatIsThereOverTheWholeRange) {
  const ToneCurve tone{0.02, 0.22, 0.5};
  EXPECT_EQ(tone(0.0), 0.0);
  EXPECT_NEAR(tone(0.07), 0.5, 1e-9);
  EXPECT_EQ(tone(0.5), 1.0);
}

// A picture of 640 x 480 px whose camera goes 0.1 to the right a frame, 10 before a wall of points.
constexpr int kFrames = 20;
constexpr int kPoints = 150;

Camera Pinhole() { return Lens(0.0); }

Reconstruction Walk(double step,
                    int frames = kFrames,
                    const Camera& camera = Pinhole(),
                    const FocalScales& scales = {}) {
  Reconstruction model;
  model.camera = camera;
  model.focal_scale = scales;
  for (int f = 0; f < frames; ++f) {
    model.cam_from_world[FrameIndex(f)].translation = Eigen::Vector3d(-step * f, 0.0, 0.0);
  }
  for (int i = 0; i < kPoints; ++i) {
    Point3D& point = model.points[FeatureId(i)];
    const int row = i / 15;
    point.in_world = Eigen::Vector3d(0.25 * (i % 15) - 1.0, 0.3 * row - 1.5, 10.0 + i % 3);
    for (const auto& [frame, cam_from_world] : model.cam_from_world) {
      point.views.push_back(
          {frame, *CameraOf(model, frame).Project(cam_from_world * point.in_world)});
    }
  }
  return model;
}

// Tracks of the model's points in kFrames frames, all observed. Of the last `moving` features the
// points move up and down, and the model has none.
TrackFile Clip(Reconstruction& model, int moving = 0) {
  TrackFile file;
  file.width_px = model.camera.width_px;
  file.height_px = model.camera.height_px;
  std::vector<Observation> observations;
  for (int f = 0; f < kFrames; ++f) {
    file.frames.push_back({FrameIndex(f), "", 0});
    for (int i = 0; i < kPoints; ++i) {
      const auto& point = model.points.at(FeatureId(i));
      Observation o{FeatureId(i), FrameIndex(f)};
      o.xy = point.views[std::min<std::size_t>(f, point.views.size() - 1)].xy;
      if (i >= kPoints - moving) o.xy.y() += 20.0 * std::sin(0.9 * f);
      observations.push_back(o);
    }
  }
  for (int i = kPoints - moving; i < kPoints; ++i) model.points.erase(FeatureId(i));
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

std::vector<std::string> Advice(const TrackFile& file,
                                const Reconstruction& model,
                                const std::vector<double>& brightness,
                                const std::string& termination = "") {
  const FilmedClip clip{file, model, termination, brightness};
  return FilmAdvice(clip, MeasureClip(clip));
}

const std::vector<double> kDaylight(kFrames, 0.4);

TEST(FilmAdvice, SaysNothingOfAGoodClip) {
  Reconstruction model = Walk(0.1);
  const TrackFile file = Clip(model);
  EXPECT_THAT(Advice(file, model, kDaylight), IsEmpty());
}

// A zoom that begins in the middle of the clip.
FocalScales LateZoom() {
  FocalScales scales;
  for (int f = 0; f < kFrames; ++f) scales[FrameIndex(f)] = 1.0 + 0.02 * std::max(0, f - 9);
  return scales;
}

TEST(FilmAdvice, SaysNothingOfAZoom) {
  Reconstruction model = Walk(0.1, kFrames, Pinhole(), LateZoom());
  const TrackFile file = Clip(model);
  EXPECT_THAT(Advice(file, model, kDaylight), IsEmpty());
  const FilmedClip clip{file, model, "", kDaylight};
  for (auto& [feature, point] : model.points) point.views.clear();
  EXPECT_EQ(MeasureClip(clip).moving_share, 0.0) << "by their tracks alone";
}

// Every point is a disc in pictures of a lens with distortion, of which each must be undistorted to
// a pinhole of its own.
TEST(WriteScene, EveryPictureOfAZoomHasItsOwnPinhole) {
  const test::TempDir dir;
  Reconstruction model = Walk(0.1, kFrames, Lens(-0.2), LateZoom());
  const TrackFile file = Clip(model);
  test::Pictures pictures;
  for (int f = 0; f < kFrames; ++f) {
    cv::Mat& picture = pictures.emplace_back(480, 640, CV_8UC1, cv::Scalar(40));
    for (const Observation* o : file.tracks.InFrame(FrameIndex(f))) {
      const cv::Point at(cvRound(16.0 * o->xy.x()), cvRound(16.0 * o->xy.y()));
      cv::circle(picture, at, 3 * 16, cv::Scalar(250), cv::FILLED, cv::LINE_AA, 4);
    }
  }
  test::PictureClip clip(pictures);
  WriteScene(file, model, clip, {.min_motion = 0.0}, dir.path());

  const Reconstruction scene = FromColmapModel(ReadColmapModel(dir / "sparse/0"));
  ASSERT_THAT(scene.cam_from_world, SizeIs(kFrames));
  for (const auto& [frame, pose] : scene.cam_from_world) {
    const Camera expected = UndistortedCamera(CameraOf(model, frame));
    EXPECT_NEAR(CameraOf(scene, frame).fx, expected.fx, 1e-9);
    EXPECT_EQ(CameraOf(scene, frame).cx, expected.cx);
  }
  EXPECT_GT(CameraOf(scene, FrameIndex{19}).fx, 1.1 * CameraOf(scene, FrameIndex{0}).fx);
  std::map<FrameIndex, cv::Mat> written;
  for (const auto& [feature, point] : scene.points) {
    for (const PointView& view : point.views) {
      const auto xy =
          CameraOf(scene, view.frame).Project(scene.cam_from_world.at(view.frame) * point.in_world);
      EXPECT_LT((view.xy - *xy).norm(), 1e-4);
      cv::Mat& picture = written[view.frame];
      const auto name = fmt::format("images/scene_{:06}.jpg", ToInt(view.frame));
      if (picture.empty()) picture = cv::imread(dir / name, cv::IMREAD_GRAYSCALE);
      EXPECT_GT(picture.at<std::uint8_t>(cvRound(xy->y()), cvRound(xy->x())), 150) << name;
    }
  }

  const nlohmann::json transforms = ReadJsonFile(dir / "transforms.json");
  EXPECT_FALSE(transforms.contains("fl_x")) << "Nerfstudio would use it for all frames";
  for (const auto& frame : transforms["frames"]) {
    const FrameIndex index = FrameOfColmapImage(frame["colmap_im_id"].get<ColmapImageId>());
    EXPECT_NEAR(frame["fl_x"].get<double>(), CameraOf(scene, index).fx, 1e-9);
    EXPECT_EQ(frame["cx"].get<double>(), 320.0);
  }
}

// COLMAP finds the mask of a picture by its name, Nerfstudio by its mask_path.
TEST(WriteScene, PicturesHaveTheMasksOfTheirFrames) {
  const test::TempDir dir;
  Reconstruction model = Walk(0.1, kFrames, Lens(-0.2));
  const TrackFile file = Clip(model);
  test::PictureClip clip(test::Pictures(kFrames, cv::Mat(480, 640, CV_8UC1, cv::Scalar(40))));
  WriteScene(file, model, clip, {.min_motion = 0.0}, dir.path());
  EXPECT_FALSE(std::filesystem::exists(dir / "masks"));
  EXPECT_FALSE(ReadJsonFile(dir / "transforms.json")["frames"][3].contains("mask_path"));

  cv::Mat left(480, 640, CV_8UC1, cv::Scalar(255));
  left.colRange(0, 320).setTo(0);
  clip.Mask(3) = left;
  WriteScene(file, model, clip, {.min_motion = 0.0}, dir.path());
  const auto transforms = ReadJsonFile(dir / "transforms.json");
  for (int f = 0; f < kFrames; ++f) {
    const std::string name = fmt::format("masks/scene_{:06}.jpg.png", f);
    EXPECT_EQ(transforms["frames"][f]["mask_path"], name);
    const cv::Mat mask = cv::imread(dir / name, cv::IMREAD_UNCHANGED);
    ASSERT_EQ(mask.size(), left.size());
    EXPECT_EQ(mask.at<std::uint8_t>(240, 300), f == 3 ? 0 : 255);
    EXPECT_EQ(mask.at<std::uint8_t>(240, 340), 255);
  }

  clip.Mask(3) = cv::Mat();
  WriteScene(file, model, clip, {.min_motion = 0.0}, dir.path());
  EXPECT_FALSE(std::filesystem::exists(dir / "masks")) << "those of the earlier scene";
}

TEST(FilmAdvice, NamesTheFramesWithoutAPoseAndThoseThatLostMost) {
  Reconstruction model = Walk(0.1, 18);
  TrackFile file = Clip(model);
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  for (Observation& o : observations) {  // nearly all end between frames 9 and 10
    if (ToInt(o.frame) >= 10 && ToInt(o.feature) > 20)
      o.feature = FeatureId{1000 + ToInt(o.feature)};
  }
  file.tracks = TrackSet::Build(std::move(observations));
  const auto advice = Advice(file, model, kDaylight);
  ASSERT_THAT(advice, SizeIs(2));
  EXPECT_THAT(advice[0], HasSubstr("At frames 9 to 10 most points were lost"));
  EXPECT_THAT(advice[1], HasSubstr("frames 18 to 19"));

  file.meta.cuts = {FrameIndex{10}};
  EXPECT_THAT(Advice(file, model, kDaylight), ElementsAre(HasSubstr("frames 18 to 19")))
      << "a cut is not speed";
}

// A headset whose features got fewer from frame to frame: no place where most were lost.
TEST(FilmAdvice, FeaturesThatGetFewerAreNotLostAtOnce) {
  Reconstruction model = Walk(0.1);
  TrackFile file = Clip(model);
  std::vector<Observation> kept;
  for (const Observation& o : file.tracks.observations()) {
    const double steps = std::max(0.0, (ToInt(o.frame) - 8.0) / 2.0);
    const auto left = static_cast<std::uint32_t>(kPoints * std::pow(0.7, steps));
    if (ToInt(o.feature) < left) kept.push_back(o);
  }
  file.tracks = TrackSet::Build(std::move(kept));
  for (const std::string& sentence : Advice(file, model, kDaylight)) {
    EXPECT_THAT(sentence, Not(HasSubstr("were lost")));
  }
}

TEST(FilmAdvice, OtherPartsOfTheClipAreKnown) {
  Reconstruction model = Walk(0.1, 12);
  TrackFile file = Clip(model);
  FilmedClip clip{file, model, "", kDaylight};
  clip.other_parts = {{FrameIndex{12}, FrameIndex{17}}};
  const auto advice = FilmAdvice(clip, MeasureClip(clip));
  ASSERT_THAT(advice, SizeIs(2));
  EXPECT_THAT(advice[0], HasSubstr("The model does not cover frames 18 to 19"));
  EXPECT_THAT(advice[1],
              AllOf(HasSubstr("Separate models of frames 12 to 17"), HasSubstr("slowly")));
  clip.other_parts = {{FrameIndex{12}, FrameIndex{19}}};
  file.meta.cuts = {FrameIndex{12}};
  clip.asides = {{FrameIndex{12}, FrameIndex{19}, AsideKind::kOtherScene}};
  EXPECT_THAT(FilmAdvice(clip, MeasureClip(clip)), IsEmpty()) << "nothing was filmed badly";
  EXPECT_THAT(DescribeAsides(clip),
              ElementsAre("frames 12 to 19 show another scene, whose model is in "
                          "model/other_parts: --frames 12:20 reconstructs it alone"));
}

// White walls: what is lost there is not the fault of speed.
TEST(FilmAdvice, WhereHardlyAnythingCouldBeTrackedBlamesTheWalls) {
  Reconstruction model = Walk(0.1);
  TrackFile file = Clip(model);
  std::vector<Observation> kept;
  for (Observation o : file.tracks.observations()) {
    if (ToInt(o.frame) >= 9 && ToInt(o.feature) > 40) continue;
    if (ToInt(o.frame) >= 10) o.feature = FeatureId{1000 + ToInt(o.feature)};
    kept.push_back(o);
  }
  file.tracks = TrackSet::Build(std::move(kept));
  const auto advice = Advice(file, model, kDaylight);
  ASSERT_FALSE(advice.empty());
  EXPECT_THAT(advice, testing::Each(Not(HasSubstr("too fast"))));
  EXPECT_THAT(advice.front(), testing::AnyOf(HasSubstr("blank walls"), HasSubstr("Only")));
}

TEST(FilmAdvice, GivesThreePiecesAtMost) {
  Reconstruction model = Walk(0.01, 12);
  TrackFile file = Clip(model, 30);
  std::vector<double> brightness(kFrames, 0.03);
  brightness[7] = 0.1;
  file.tracks = file.tracks.Select([](FeatureId feature) { return ToInt(feature) % 3 == 0; });
  EXPECT_THAT(Advice(file, model, brightness), SizeIs(3));
}

TEST(DescribeAsides, BlackFramesAreCalledBlack) {
  Reconstruction model = Walk(0.1);
  const TrackFile file = Clip(model);
  std::vector<double> brightness(kFrames, 0.4);
  brightness[0] = brightness[1] = 0.0;
  FilmedClip clip{file, model, "", brightness};
  clip.asides = {{FrameIndex{0}, FrameIndex{1}, AsideKind::kBlank},
                 {FrameIndex{2}, FrameIndex{6}, AsideKind::kCard}};
  EXPECT_THAT(DescribeAsides(clip),
              ElementsAre("frames 0 to 1 are black",
                          "frames 2 to 6 show a still picture, such as a title card"));
  EXPECT_THAT(FilmAdvice(clip, MeasureClip(clip)), IsEmpty()) << "their light is not the scene's";
}

TEST(FilmAdvice, SaysThatItIsDarkAndThatTheLightJumpsOrChanges) {
  Reconstruction model = Walk(0.1);
  const TrackFile file = Clip(model);
  std::vector<double> brightness(kFrames, 0.03);
  brightness[7] = 0.1;
  const auto advice = Advice(file, model, brightness);
  ASSERT_THAT(advice, SizeIs(2));
  EXPECT_THAT(advice[0], HasSubstr("8 of 255"));
  EXPECT_THAT(advice[1], HasSubstr("frames 7 to 8"));
  for (int f = 0; f < kFrames; ++f) brightness[f] = 0.02 * std::pow(1.3, f);
  EXPECT_THAT(Advice(file, model, brightness), ElementsAre(HasSubstr("The light changes from")));
}

TEST(FilmAdvice, KnowsACameraThatHardlyMoved) {
  Reconstruction model = Walk(0.01);  // 0.19 of 11: a degree
  const TrackFile file = Clip(model);
  EXPECT_THAT(Advice(file, model, kDaylight), ElementsAre(HasSubstr("hardly moved")));
}

TEST(FilmAdvice, KnowsThingsThatMoveFromPointsThatAreMerelyMissing) {
  Reconstruction model = Walk(0.1);
  const TrackFile moving = Clip(model, 30);
  const auto advice = Advice(moving, model, kDaylight);
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice[0], HasSubstr("Something moves in the picture: 20 %"));
  Reconstruction sparse = Walk(0.1);
  const TrackFile still = Clip(sparse);
  for (int i = 0; i < 60; ++i) sparse.points.erase(FeatureId(i));
  EXPECT_THAT(Advice(still, sparse, kDaylight), IsEmpty());
}

TEST(FilmAdvice, CountsFewPointsByWhatWasAskedFor) {
  Reconstruction model = Walk(0.1);
  TrackFile file = Clip(model);
  file.tracks = file.tracks.Select([](FeatureId feature) { return ToInt(feature) < 60; });
  EXPECT_THAT(Advice(file, model, kDaylight), ElementsAre(HasSubstr("Only 60 points")));
  const FilmedClip clip{file, model, "", kDaylight, 80};
  EXPECT_THAT(FilmAdvice(clip, MeasureClip(clip)), IsEmpty());
}

TEST(FilmAdvice, OfAClipWithoutAModelSaysWhatToDoByHowItEnded) {
  Reconstruction model = Walk(0.1);
  const TrackFile file = Clip(model);
  for (const auto& [termination, words] : std::map<std::string, std::string>{
           {"static camera: the picture moves by 2.0 px at most", "stood still"},
           {"pure rotation: a rotation explains", "only turned on the spot"},
           {"not rigid: no rigid scene", "move on their own"},
           {"weak depth: depths are known only to within 120 %", "moved too little"},
           {"too few tracks: no two frames", "Hardly any points"},
           {"no start: there is parallax", "walk slowly past it"},
           {TerminationLine(NoGeometryEnd(15)), "walk slowly past it"},
           {"what another program says", "walk slowly past it"}}) {
    EXPECT_THAT(Advice(file, {}, kDaylight, termination), ElementsAre(HasSubstr(words)))
        << termination;
  }
}

}  // namespace
}  // namespace cohort
