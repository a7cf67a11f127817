// Tracks as users of point trackers save them, by the real NumPy.

#include "frontend/tracks/track_npz.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "frontend/storage/npz.h"
#include "frontend/storage/output.h"
#include "tests/support/numpy.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::RunNumpy;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

std::vector<FrameInfo> Frames(std::uint32_t count, std::uint32_t stride = 1) {
  std::vector<FrameInfo> frames;
  for (std::uint32_t i = 0; i < count; ++i) {
    frames.push_back({FrameIndex{i * stride}, fmt::format("{}.png", i * stride), 0});
  }
  return frames;
}

// Files i/a.npz that scripts write of tracks (4 frames x 3 points x 2) and vis, of which one is
// hidden. One Python for all: its start is what takes time.
class Saved {
 public:
  explicit Saved(const std::vector<std::string>& scripts) {
    std::string all = "import os\n";
    for (std::size_t i = 0; i < scripts.size(); ++i) {
      all += fmt::format(
          "os.mkdir('{0}'); os.chdir('{0}')\n"
          "tracks = np.arange(24, dtype=np.float32).reshape(4, 3, 2) + 0.25\n"
          "vis = np.ones((4, 3), dtype=bool); vis[2, 1] = False\n"
          "def swap(a): return np.swapaxes(a, 0, 1)\n"
          "{1}\nos.chdir('..')\n",
          i,
          scripts[i]);
    }
    RunNumpy(dir_.path(), all);
  }

  ImportedTracks Read(std::size_t i,
                      const NpzTracksOptions& options = {},
                      const std::vector<FrameInfo>& frames = Frames(4)) const {
    return ReadTracksNpz(
        dir_.path() / std::to_string(i) / "a.npz", frames, kWidth, kHeight, options);
  }

 private:
  TempDir dir_;
};

// What every way of saving those must give.
void ExpectTheTracks(const ImportedTracks& imported, const std::string& how) {
  SCOPED_TRACE(how);
  ASSERT_EQ(imported.tracks.observations().size(), 12u);
  for (std::uint32_t t = 0; t < 4; ++t) {
    for (std::uint32_t n = 0; n < 3; ++n) {
      const Observation* o = imported.tracks.Find(FeatureId{n}, FrameIndex{t});
      ASSERT_NE(o, nullptr);
      const double first = 6.0 * t + 2.0 * n + 0.25;
      EXPECT_EQ(o->xy, Eigen::Vector2d(first, first + 1.0));
      EXPECT_EQ(IsObserved(*o), !(t == 2 && n == 1));
      EXPECT_FALSE(o->covariance);
    }
  }
}

TEST(TracksNpz, ReadsThemAsUsersOfPointTrackersSaveThem) {
  const std::vector<std::string> ways = {
      // CoTracker: B T N 2, B T N, also B T N 1
      "np.savez('a.npz', tracks=tracks[None], visibility=vis[None])",
      "np.savez('a.npz', pred_tracks=tracks[None], pred_visibility=vis[None, ..., None])",
      "np.savez_compressed('a.npz', tracks=tracks, visibility=vis)",
      // TAPIR, TAPNext: N T 2 and visibles, or occluded; a batch of one before it
      "np.savez('a.npz', tracks=swap(tracks), visibles=swap(vis))",
      "np.savez('a.npz', tracks=swap(tracks)[None], occluded=~swap(vis)[None])",
      "np.savez('a.npz', pred_tracks=swap(tracks), pred_occluded=(~swap(vis)).astype(np.uint8))",
      // VGGSfM, VGGT: probabilities and scores
      "np.savez('a.npz', pred_tracks=tracks, pred_vis=0.2 + 0.6 * vis, pred_score=np.ones((4,3)))",
      "np.savez('a.npz', tracks=tracks, vis=np.ones((4, 3)), conf=0.1 + 0.8 * vis)",
      // the frames' pictures beside them
      "np.savez('a.npz', tracks=tracks, vis=vis, frames=np.zeros((4, 2, 2, 3), np.uint8))",
      "np.savez('a.npz', tracks=np.asfortranarray(tracks, dtype=np.float64), vis=vis)",
      "np.savez('a.npz', tracks=tracks.astype(np.float16), vis=vis)",
      "np.savez('a.npz', paths=tracks, seen=vis)"};
  const Saved saved(ways);
  for (std::size_t i = 0; i + 1 < ways.size(); ++i) ExpectTheTracks(saved.Read(i), ways[i]);
  ExpectTheTracks(saved.Read(ways.size() - 1, {.tracks = "paths", .visibility = "seen"}),
                  ways.back());
}

TEST(TracksNpz, CovariancesAreOfThePicturesSizeToo) {
  const Saved saved(
      {"np.savez('a.npz', tracks=tracks, vis=vis, "
       "covariance=np.full((4, 3, 3), [0.5, 0.125, 0.25]))"});
  const ImportedTracks imported =
      saved.Read(0, {.size = fmt::format("{}x{}", kWidth / 2, kHeight)});
  const Observation* o = imported.tracks.Find(FeatureId{1}, FrameIndex{1});
  ASSERT_TRUE(o != nullptr && o->covariance);
  EXPECT_EQ(o->covariance->Matrix(), (Eigen::Matrix2d{{2.0, 0.25}, {0.25, 0.25}}));
}

TEST(TracksNpz, ThresholdsAreOptions) {
  const Saved saved({"np.savez('a.npz', tracks=tracks, vis=0.2 + 0.6 * vis, conf=0.3 * vis)"});
  EXPECT_EQ(saved.Read(0, {.min_confidence = 0.1}).tracks.CountObserved(), 11u);
  EXPECT_EQ(saved.Read(0, {.min_visibility = 0.1, .min_confidence = 0.0}).tracks.CountObserved(),
            12u);
  EXPECT_EQ(saved.Read(0).tracks.CountObserved(), 0u);
}

TEST(TracksNpz, WithoutVisibilityWhatIsNotANumberIsNoPosition) {
  const ImportedTracks imported =
      Saved({"tracks[1, 2] = np.nan\nnp.savez('a.npz', tracks=tracks)"}).Read(0);
  EXPECT_EQ(imported.tracks.CountObserved(), 11u);
  EXPECT_EQ(imported.tracks.Find(FeatureId{2}, FrameIndex{1}), nullptr);
}

TEST(TracksNpz, FramesAreThoseChosenOrThoseThatTheFileNames) {
  const std::string save = "np.savez('a.npz', tracks=tracks, vis=vis";
  const Saved saved({save + ")",
                     save + ", frame_indices=np.array([9, 2, 4, 6]))",
                     save + ", frames=np.array([0, 1, 2, 12]))",
                     save + ", frames=np.array([0, 1, 2, 2]))",
                     save + ", frames=np.array([0, 1, 2, -1]))"});
  EXPECT_EQ(saved.Read(0, {}, Frames(4, 5)).tracks.frames().back(), FrameIndex{15});
  const ImportedTracks named = saved.Read(1, {}, Frames(12));
  EXPECT_EQ(named.tracks.Find(FeatureId{0}, FrameIndex{9})->xy.x(), 0.25);
  EXPECT_EQ(named.tracks.Find(FeatureId{0}, FrameIndex{2})->xy.x(), 6.25);
  EXPECT_THAT([&] { saved.Read(2, {}, Frames(12)); },
              ThrowsMessage<Error>(HasSubstr("frame 12 is not among the 12 of the input")));
  EXPECT_THAT([&] { saved.Read(3, {}, Frames(12)); }, ThrowsMessage<Error>(HasSubstr("twice")));
  EXPECT_THAT([&] { saved.Read(4, {}, Frames(12)); }, ThrowsMessage<Error>(HasSubstr("frame -1")));
}

TEST(TracksNpz, OriginAndSizeAreBroughtToOurs) {
  const Saved saved({"np.savez('a.npz', tracks=tracks, vis=vis)"});
  const auto first = [&](const NpzTracksOptions& options) {
    return saved.Read(0, options).tracks.Find(FeatureId{0}, FrameIndex{0})->xy;
  };
  EXPECT_EQ(first({}), Eigen::Vector2d(0.25, 1.25));
  EXPECT_EQ(first({.origin = NpzOrigin::kPixelCorner}), Eigen::Vector2d(-0.25, 0.75));
  // 32 x 12 to 64 x 48: the outer corners stay where they are.
  EXPECT_EQ(first({.size = "32x12", .min_visibility = 0.0}),
            Eigen::Vector2d(0.75 * 2 - 0.5, 1.75 * 4 - 0.5));
  EXPECT_EQ(first({.origin = NpzOrigin::kPixelCorner, .size = "64x12"}),
            Eigen::Vector2d(0.25 - 0.5, 1.25 * 4 - 0.5));
  for (const char* wrong : {"32", "32x", "x", "0x12", "32x12x3", "-1x3"}) {
    EXPECT_THAT([&] { first({.size = wrong}); },
                ThrowsMessage<UsageError>(AllOf(HasSubstr("--npz.size"), HasSubstr(wrong))));
  }
}

// As np.save writes the positions alone.
TEST(TracksNpz, ReadsPlainArrays) {
  const Saved saved(
      {"np.save('b.npy', tracks); os.rename('b.npy', 'a.npz')",
       "np.save('b.npy', np.asfortranarray(swap(tracks))); os.rename('b.npy', 'a.npz')",
       "np.save('b.npy', tracks[:, :, :1]); os.rename('b.npy', 'a.npz')",
       "np.save('b.npy', tracks); os.truncate('b.npy', 200);"
       "os.rename('b.npy', 'a.npz')"});
  for (const std::size_t i : {0u, 1u}) {
    const TrackSet tracks = saved.Read(i).tracks;
    ASSERT_EQ(tracks.observations().size(), 12u);
    EXPECT_EQ(tracks.Find(FeatureId{1}, FrameIndex{2})->xy, Eigen::Vector2d(14.25, 15.25));
    EXPECT_TRUE(IsObserved(*tracks.Find(FeatureId{1}, FrameIndex{2})));
  }
  EXPECT_THAT([&] { saved.Read(2); }, ThrowsMessage<Error>(HasSubstr("4 x 3 x 1")));
  EXPECT_THAT([&] { saved.Read(3); }, ThrowsMessage<Error>(HasSubstr("does not fit")));
}

TEST(TracksNpz, UnitsAndAxesAreBroughtToOurs) {
  const Saved saved({"np.savez('a.npz', tracks=tracks)",
                     "np.savez('a.npz', tracks=tracks / (64, 48))",
                     "np.savez('a.npz', tracks=tracks / (32, 24) - 1)",
                     "np.savez('a.npz', tracks=tracks[:, :, ::-1])",
                     "np.savez('a.npz', tracks=(tracks / (64, 48))[:, :, ::-1])",
                     "np.savez('a.npz', tracks=(tracks + 0.5) / (64, 48))"});
  const std::vector<NpzTracksOptions> options{
      {},
      {.units = NpzUnits::kZeroToOne},
      {.units = NpzUnits::kMinusOneToOne},
      {.axes = NpzAxes::kYx},
      {.units = NpzUnits::kZeroToOne, .axes = NpzAxes::kYx},
      {.origin = NpzOrigin::kPixelCorner, .units = NpzUnits::kZeroToOne}};
  for (std::size_t i = 0; i < options.size(); ++i) {
    const TrackSet tracks = saved.Read(i, options[i]).tracks;
    ASSERT_EQ(tracks.observations().size(), 12u);
    const Eigen::Vector2d xy = tracks.Find(FeatureId{1}, FrameIndex{2})->xy;
    EXPECT_LT((xy - Eigen::Vector2d(14.25, 15.25)).norm(), 1e-4) << i;
  }
}

TEST(TracksNpz, SaysThatPositionsAreProbablyShares) {
  EXPECT_THAT([] { Saved({"np.savez('a.npz', tracks=tracks / 60 - 1)"}).Read(0); },
              ThrowsMessage<Error>(HasSubstr("--npz.units minus-one-to-one")));
}

// In pictures of 64 x 48, x up to 47 and y up to 63.
TEST(TracksNpz, SaysThatXAndYAreProbablyExchanged) {
  const std::string spread =
      "tracks = np.stack(np.meshgrid(np.linspace(1, 46, 40), np.linspace(1, 62, 4)), -1)\n"
      "tracks[:, :, 1] = np.linspace(1, 62, 40)\n";
  const Saved saved({spread + "np.savez('a.npz', tracks=tracks)",
                     spread + "np.savez('a.npz', tracks=tracks[:, :, ::-1])"});
  const ImportedTracks exchanged = saved.Read(0);
  EXPECT_GT(exchanged.left_out, 10u);
  EXPECT_TRUE(exchanged.fits_exchanged);
  const ImportedTracks honest = saved.Read(1);
  EXPECT_EQ(honest.left_out, 0u);
  EXPECT_FALSE(honest.fits_exchanged);
}

TEST(TracksNpz, AsManyTracksAsFramesMustBeSaidWhichIsWhich) {
  const Saved saved({"np.savez('a.npz', tracks=np.arange(18.0).reshape(3, 3, 2))"});
  EXPECT_THAT([&] { saved.Read(0, {}, Frames(3)); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.npz"), HasSubstr("--npz.layout"))));
  const auto at = [&](NpzLayout layout) {
    return saved.Read(0, {.layout = layout}, Frames(3))
        .tracks.Find(FeatureId{2}, FrameIndex{1})
        ->xy;
  };
  EXPECT_EQ(at(NpzLayout::kFramesFirst), Eigen::Vector2d(10, 11));
  EXPECT_EQ(at(NpzLayout::kTracksFirst), Eigen::Vector2d(14, 15));
}

TEST(TracksNpz, SaysInOneLineWhatCannotBe) {
  struct Case {
    std::string save;
    std::string why;
    NpzTracksOptions options = {};
  };
  const std::vector<Case> cases = {
      {"np.savez('a.npz', points=tracks, other=vis)", "has no array tracks, but points, other"},
      {"np.savez('a.npz')", "no array tracks, but none"},
      {"np.savez('a.npz', tracks=tracks)", "no array paths", {.tracks = "paths"}},
      {"np.savez('a.npz', tracks=tracks)", "array seen: there is none", {.visibility = "seen"}},
      {"np.savez('a.npz', tracks=np.zeros((5, 6, 2)))", "neither axis is the 4 frames"},
      {"np.savez('a.npz', tracks=tracks)",
       "not its second axis is the 4 frames",
       {.layout = NpzLayout::kTracksFirst}},
      {"np.savez('a.npz', tracks=np.zeros((4, 3, 3)))", "it is 4 x 3 x 3"},
      {"np.savez('a.npz', tracks=np.zeros((2, 4, 3, 2)))", "it is 2 x 4 x 3 x 2"},
      {"np.savez('a.npz', tracks=np.float64(1))", "it is 1"},
      {"np.savez('a.npz', tracks=np.zeros((4, 0, 2)))", "no position"},
      {"np.savez('a.npz', tracks=tracks, vis=swap(vis))", "it is 3 x 4 instead of 4 x 3"},
      {"np.savez('a.npz', tracks=tracks, vis=vis[:3])", "it is 3 x 3 instead of 4 x 3"},
      {"np.savez('a.npz', tracks=tracks, occlusion=10.0 * vis)", "10 is not a probability"},
      {"np.savez('a.npz', tracks=tracks, vis=np.full((4, 3), np.nan))", "nan is not a probability"},
      {"np.savez('a.npz', tracks=tracks[:0], frame_indices=np.zeros(0, int))", "lists no frame"},
      {"tracks[3, 1] = np.nan\nnp.savez('a.npz', tracks=tracks, vis=vis)",
       "track 1 in frame 3 is nan, nan and visible"},
      {"tracks[3, 1] = np.inf\nnp.savez('a.npz', tracks=tracks)", "track 1 in frame 3 is inf"},
      {"np.savez('a.npz', tracks=tracks, track_ids=np.array([1, 1, 2]))", "1 occurs twice"},
      {"np.savez('a.npz', tracks=tracks, track_ids=np.array([1, 2]))", "instead of 3 integers"},
      {"np.savez('a.npz', tracks=tracks, track_ids=np.array([1, 2, 1 << 32]))", "32 bits"},
      {"np.savez('a.npz', tracks=tracks, covariance=np.ones((4, 3, 3)))", "positive definite"},
      {"np.savez('a.npz', tracks=np.array([[{}]], dtype=object))", "Python objects"},
      {"np.savez('a.npz', tracks=tracks * 10)", "--npz.size"},
  };
  std::vector<std::string> scripts;
  for (const Case& c : cases) scripts.push_back(c.save);
  const Saved saved(scripts);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    EXPECT_THAT([&] { saved.Read(i, cases[i].options); },
                ThrowsMessage<Error>(
                    AllOf(HasSubstr("a.npz"), HasSubstr(cases[i].why), Not(HasSubstr("\n")))))
        << cases[i].save;
  }
}

TEST(TracksNpz, APositionOutsideThePictureIsNotObserved) {
  const ImportedTracks imported =
      Saved({"tracks[0, 0] = (-3, 5)\nnp.savez('a.npz', tracks=tracks, vis=vis)"}).Read(0);
  EXPECT_EQ(imported.left_out, 1u);
  EXPECT_FALSE(IsObserved(*imported.tracks.Find(FeatureId{0}, FrameIndex{0})));
}

TrackFile SomeTracks() {
  TrackFile file;
  file.width_px = kWidth;
  file.height_px = kHeight;
  file.frames = {
      {FrameIndex{2}, "2.png", 0}, {FrameIndex{3}, "3.png", 0}, {FrameIndex{9}, "9.png", 0}};
  file.tracks = TrackSet::Build(
      {{.feature = FeatureId{7},
        .frame = FrameIndex{2},
        .xy = {1.0 / 3.0, 2.0},
        .residual = 0.125,
        .covariance = PixelCovariance{0.5F, -0.1F, 0.25F}},
       {.feature = FeatureId{7},
        .frame = FrameIndex{9},
        .xy = {5.5, 6.5},
        .state = ObservationState::kPredicted},
       {.feature = FeatureId{UINT32_MAX}, .frame = FrameIndex{9}, .xy = {0.1, 47.25}}});
  return file;
}

TEST(TracksNpz, ReadsBackWhatWasWrittenToTheLastBit) {
  const TempDir dir;
  const TrackFile file = SomeTracks();
  WriteTracksNpz(dir / "a.npz", file);
  const TrackSet read = ReadTracksNpz(dir / "a.npz", Frames(12), kWidth, kHeight).tracks;
  ASSERT_EQ(read.observations().size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    const Observation& a = file.tracks.observations()[i];
    const Observation& b = read.observations()[i];
    EXPECT_EQ(a.feature, b.feature);
    EXPECT_EQ(a.frame, b.frame);
    EXPECT_EQ(a.xy, b.xy);
    EXPECT_EQ(a.state, b.state);
    EXPECT_EQ(a.residual, b.residual);
    ASSERT_EQ(a.covariance.has_value(), b.covariance.has_value());
    if (a.covariance) {
      EXPECT_EQ(a.covariance->Matrix(), b.covariance->Matrix());
    }
  }
}

TEST(TracksNpz, NumpyReadsTheArraysThatAreDocumented) {
  const TempDir dir;
  WriteTracksNpz(dir / "a.npz", SomeTracks());
  EXPECT_EQ(
      RunNumpy(
          dir.path(),
          "z = np.load('a.npz')\n"
          "for name in z: print(name, z[name].shape, z[name].dtype)\n"
          "print(z['tracks'][2].tolist(), z['visibility'][2], np.isnan(z['tracks'][1]).all())"),
      "tracks (3, 2, 2) float64\n"
      "visibility (3, 2) bool\n"
      "residual (3, 2) float64\n"
      "covariance (3, 2, 3) float32\n"
      "track_ids (2,) int64\n"
      "frame_indices (3,) int64\n"
      "[[5.5, 6.5], [0.1, 47.25]] [False  True] True\n");
}

// By its header, before there is memory for what a small file of zeros unpacks to.
TEST(TracksNpz, MoreCellsThanAreWrittenAreNotRead) {
  const auto save = [](const char* shape) {
    return fmt::format(
        "import zipfile, struct\n"
        "header = b\"{{'descr': '|u1', 'fortran_order': False, 'shape': ({}), }}\"\n"
        "with zipfile.ZipFile('a.npz', 'w') as z:\n"
        "  z.writestr('tracks.npy', b'\\x93NUMPY\\x01\\x00' + struct.pack('<H', len(header)) +\n"
        "             header + bytes(8))",
        shape);
  };
  const Saved saved(
      {save("4, 33554432, 2"), save("4, 33554433, 2"), save("0, 1152921504606846976, 2")});
  EXPECT_THAT([&] { saved.Read(0); }, ThrowsMessage<Error>(HasSubstr("does not fit its 8 bytes")));
  EXPECT_THAT([&] { saved.Read(1); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.npz, array tracks: it is 4 x 33554433 x 2"),
                                         HasSubstr("268435456 numbers are the maximum"))));
  EXPECT_THAT([&] { saved.Read(2); }, ThrowsMessage<Error>(HasSubstr("268435456 numbers are")));
}

// Which may be many GB, and are not needed: the header says what they are.
TEST(TracksNpz, PicturesBesideTheTracksAreNotRead) {
  const Saved saved(
      {"np.savez('a.npz', tracks=tracks, vis=vis)\n"
       "import zipfile, struct\n"
       "header = b\"{'descr': '|u1', 'fortran_order': False, 'shape': (4, 20000, 20000, 3), }\"\n"
       "with zipfile.ZipFile('a.npz', 'a') as z:\n"
       "  z.writestr('frames.npy', b'\\x93NUMPY\\x01\\x00' + struct.pack('<H', len(header)) +\n"
       "             header)",
       "np.savez('a.npz', tracks=tracks, vis=vis, frames=np.array(['a', 'b', 'c', 'd']))"});
  ExpectTheTracks(saved.Read(0), "pictures");
  ExpectTheTracks(saved.Read(1), "names");
}

TEST(TracksNpz, ATableTooLargeForMemoryIsRefused) {
  const TempDir dir;
  TrackFile file;
  file.frames = Frames(20'000);
  std::vector<Observation> observations;
  for (std::uint32_t n = 0; n < 10'000; ++n) observations.push_back({.feature = FeatureId{n}});
  file.tracks = TrackSet::Build(std::move(observations));
  EXPECT_THAT([&] { WriteTracksNpz(dir / "a.npz", file); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.npz"), HasSubstr("--csv"))));
}

}  // namespace
}  // namespace cohort
