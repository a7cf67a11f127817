#include "backend/colmap/keypoint_covariances.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "frontend/storage/npz.h"
#include "frontend/storage/output.h"
#include "tests/support/numpy.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::TempDir;
using testing::HasSubstr;
using testing::ThrowsMessage;

// Tracks of which observation i has a covariance of its own, every tenth a weak one, every 31st
// none.
TrackFile WithCovariances() {
  TrackFile file = test::MakeSyntheticTracks({.frames = 8, .points = 60}).file;
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const float size = i % 10 == 9 ? 9.0F : 0.25F + 0.0001F * static_cast<float>(i);
    if (i % 31 != 30) observations[i].covariance = PixelCovariance{size, 0.05F, 1.5F * size};
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

TEST(KeypointCovariances, StandInTheOrderOfTheDatabase) {
  const TempDir dir;
  const TrackFile file = WithCovariances();
  WriteColmapDatabase(dir / "a.db", file);
  const CovarianceCounts counts = WriteKeypointCovariances(dir / "a.npz", file);
  const ColmapDatabase database = ReadColmapDatabase(dir / "a.db");

  NpzReader npz(dir / "a.npz");
  const auto values = [&](const char* name) { return npz.Read(name).values; };
  const auto image_id = values("image_id");
  const auto keypoint = values("keypoint");
  const auto track_id = values("track_id");
  const auto xy = values("xy");
  const auto covariance = values("covariance");
  std::size_t row = 0;
  std::size_t without = 0;
  for (const auto& [id, image] : database.images) {
    for (std::size_t k = 0; k < image.keypoints.size(); ++k, ++row) {
      ASSERT_LT(row, image_id.size());
      EXPECT_EQ(image_id[row], id);
      EXPECT_EQ(keypoint[row], static_cast<double>(k));
      EXPECT_EQ(xy[2 * row], image.keypoints[k].x());
      EXPECT_EQ(xy[2 * row + 1], image.keypoints[k].y());
      const Observation* o = file.tracks.Find(FeatureId{static_cast<std::uint32_t>(track_id[row])},
                                              FrameOfColmapImage(id));
      ASSERT_NE(o, nullptr);
      EXPECT_EQ((o->xy.array() + 0.5).matrix().cast<float>(), image.keypoints[k]);
      if (!o->covariance) {
        EXPECT_TRUE(std::isnan(covariance[4 * row]));
        ++without;
        continue;
      }
      EXPECT_LT(o->covariance->xx, 9.0F);  // the weak ones are not in the database
      EXPECT_EQ(covariance[4 * row], o->covariance->xx);
      EXPECT_EQ(covariance[4 * row + 1], o->covariance->xy);
      EXPECT_EQ(covariance[4 * row + 2], o->covariance->xy);
      EXPECT_EQ(covariance[4 * row + 3], o->covariance->yy);
    }
  }
  EXPECT_EQ(row, image_id.size());
  EXPECT_EQ(counts.keypoints, row);
  EXPECT_EQ(counts.without, without);
  EXPECT_GT(without, 0u);
}

TEST(KeypointCovariances, TheTableHasTheSame) {
  const TempDir dir;
  TrackFile file = WithCovariances();
  file.frames[0].name = "a \"first\", one.png";
  WriteKeypointCovariances(dir / "a.npz", file);
  WriteKeypointCovariances(dir / "a.csv", file);
  EXPECT_EQ(test::RunNumpy(
                dir.path(),
                "import csv\n"
                "z = np.load('a.npz')\n"
                "names = dict(zip(z['image_ids'], (name.decode() for name in z['image_names'])))\n"
                "rows = list(csv.DictReader(open('a.csv')))\n"
                "print(','.join(rows[0]))\n"
                "print(len(rows) == len(z['keypoint']), rows[0]['image_name'])\n"
                "number = lambda text: float(text) if text else np.nan\n"
                "for i, row in enumerate(rows):\n"
                "  assert names[int(row['image_id'])] == row['image_name']\n"
                "  assert int(row['image_id']) == z['image_id'][i]\n"
                "  assert int(row['keypoint']) == z['keypoint'][i]\n"
                "  assert int(row['track_id']) == z['track_id'][i]\n"
                "  assert np.float32(row['x']) == z['xy'][i, 0]\n"
                "  c = z['covariance'][i]\n"
                "  np.testing.assert_array_equal(np.float32([number(row['cov_' + k]) for k in "
                "('xx', 'xy', 'yy')]), np.float32([c[0, 0], c[0, 1], c[1, 1]]))\n"
                "print('same')"),
            "image_id,image_name,keypoint,track_id,x,y,cov_xx,cov_xy,cov_yy\n"
            "True a \"first\", one.png\nsame\n");
}

TEST(KeypointCovariances, TracksWithoutAnyAreOneError) {
  const TempDir dir;
  const TrackFile file = test::MakeSyntheticTracks({.frames = 3, .points = 20}).file;
  EXPECT_THAT([&] { WriteKeypointCovariances(dir / "a.csv", file); },
              ThrowsMessage<Error>(HasSubstr("no position has a covariance")));
  EXPECT_FALSE(std::filesystem::exists(dir / "a.csv"));
}

}  // namespace
}  // namespace cohort
