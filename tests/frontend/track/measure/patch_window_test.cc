// Sums over windows in lanes against the same in double, pixel by pixel.

#include "frontend/track/measure/patch_window.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

const cv::Mat& Picture() {
  static const cv::Mat kPicture =
      test::ImageOf([](double x, double y) { return test::WavesAt(x, y); }, 120, 90, CV_32F);
  return kPicture;
}

// A window, its pixel at (u, v) from the centre.
struct Pixel {
  Eigen::Vector2d offset;
  double value;
  Eigen::Vector2d gradient;
};
std::vector<Pixel> PixelsOf(const PatchWindow& window) {
  std::vector<Pixel> pixels;
  for (int r = 0; r < window.n; ++r) {
    for (int c = 0; c < window.n; ++c) {
      const int at = r * window.stride + c;
      pixels.push_back({Eigen::Vector2d(c - window.n / 2, r - window.n / 2),
                        window.values[at],
                        Eigen::Vector2d(window.dx[at], window.dy[at])});
    }
  }
  return pixels;
}

class WindowOf : public testing::TestWithParam<int> {
 protected:
  WindowOf() {
    FillWindow(Picture(), {60.3, 44.8}, GetParam(), *window_);
    FillWindow(Picture(), seen_at_, GetParam(), *seen_);
  }

  const Eigen::Vector2d seen_at_{61.1, 44.2};
  std::unique_ptr<PatchWindow> window_ = std::make_unique<PatchWindow>();
  std::unique_ptr<PatchWindow> seen_ = std::make_unique<PatchWindow>();
};
INSTANTIATE_TEST_SUITE_P(Sides, WindowOf, testing::Values(5, 7, 9, 21, 31, 63));

TEST_P(WindowOf, GradientsAreThePicturesWithoutTheirMean) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double values = 0.0;
  for (const Pixel& pixel : PixelsOf(*window_)) {
    sum += pixel.gradient;
    values += pixel.value;
  }
  const double area = GetParam() * GetParam();
  EXPECT_LT(sum.norm() / area, 1e-6);
  EXPECT_NEAR(window_->mean, values / area, 1e-6);
  // Neighbours' differences, where Scharr's is theirs: along a wave it is the derivative blurred.
  const auto at = [&](int r, int c) {
    return static_cast<double>(window_->values[r * window_->stride + c]);
  };
  const auto dx = [&](int r, int c) {
    return (3.0 * (at(r - 1, c + 1) - at(r - 1, c - 1) + at(r + 1, c + 1) - at(r + 1, c - 1)) +
            10.0 * (at(r, c + 1) - at(r, c - 1))) /
           32.0;
  };
  EXPECT_NEAR(window_->dx[1 * window_->stride + 1] - window_->dx[2 * window_->stride + 2],
              dx(1, 1) - dx(2, 2),
              1e-6);
}

TEST_P(WindowOf, BehindTheRowsIsNothing) {
  for (int r = 0; r < window_->n; ++r) {
    for (int c = window_->n; c < window_->stride; ++c) {
      EXPECT_EQ(window_->values[r * window_->stride + c], 0.0F);
      EXPECT_EQ(window_->dx[r * window_->stride + c], 0.0F);
      EXPECT_EQ(window_->dy[r * window_->stride + c], 0.0F);
    }
  }
}

TEST_P(WindowOf, AWarpThatIsNoneGivesTheSameWindow) {
  auto warped = std::make_unique<PatchWindow>();
  FillWarpedWindow(Picture(), seen_at_, Eigen::Matrix2d::Identity(), GetParam(), *warped);
  for (int i = 0; i < warped->n * warped->stride; ++i) {
    ASSERT_NEAR(warped->values[i], seen_->values[i], 1e-5);
  }
}

TEST_P(WindowOf, TranslationEquationsAreTheSumsPixelByPixel) {
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  const std::vector<Pixel> window = PixelsOf(*window_);
  const std::vector<Pixel> seen = PixelsOf(*seen_);
  for (std::size_t i = 0; i < window.size(); ++i) {
    const Eigen::Vector2d g = 0.5 * (window[i].gradient + seen[i].gradient);
    hessian += g * g.transpose();
    gradient += (seen[i].value - window[i].value) * g;
  }
  const TranslationEquations equations = LinearizeTranslation(Picture(), seen_at_, *window_);
  EXPECT_LT((equations.hessian - hessian).norm(), 1e-5 * hessian.norm());
  EXPECT_LT((equations.gradient - gradient).norm(), 1e-4 * gradient.norm());
}

TEST_P(WindowOf, WarpEquationsAreTheSumsPixelByPixel) {
  Matrix7d normal = Matrix7d::Zero();
  Vector7d rhs = Vector7d::Zero();
  Eigen::Matrix2d cross = Eigen::Matrix2d::Zero();
  const std::vector<Pixel> window = PixelsOf(*window_);
  const std::vector<Pixel> seen = PixelsOf(*seen_);
  for (std::size_t i = 0; i < window.size(); ++i) {
    const Eigen::Vector2d g = 0.5 * (window[i].gradient + seen[i].gradient);
    const Eigen::Vector2d& u = window[i].offset;
    Vector7d j;
    j << g, g.x() * u, g.y() * u, 1.0;
    normal += j * j.transpose();
    rhs -= (seen[i].value - window[i].value) * j;
    const Eigen::Matrix2d product = window[i].gradient * seen[i].gradient.transpose();
    cross += 0.5 * (product + product.transpose());
  }
  const WarpEquations equations = LinearizeWarp(*seen_, *window_);
  EXPECT_LT((equations.normal - normal).norm(), 1e-5 * normal.norm());
  EXPECT_LT((equations.rhs - rhs).norm(), 1e-4 * rhs.norm());
  EXPECT_LT((equations.cross - cross).norm(), 1e-5 * cross.norm());
}

TEST_P(WindowOf, ComparisonIsOfWhatDiffersFromTheMeans) {
  const std::vector<Pixel> window = PixelsOf(*window_);
  const std::vector<Pixel> seen = PixelsOf(*seen_);
  WindowComparison expected;
  for (std::size_t i = 0; i < window.size(); ++i) {
    const double s = seen[i].value - seen_->mean;
    const double w = window[i].value - window_->mean;
    expected.squares += s * s;
    expected.window_squares += w * w;
    expected.products += s * w;
    expected.absolute += std::abs(seen[i].value - window[i].value);
  }
  const WindowComparison sums = CompareWindows(*seen_, *window_);
  EXPECT_NEAR(sums.squares, expected.squares, 1e-5 * expected.squares);
  EXPECT_NEAR(sums.window_squares, expected.window_squares, 1e-5 * expected.window_squares);
  EXPECT_NEAR(sums.products, expected.products, 1e-5 * expected.squares);
  EXPECT_NEAR(sums.absolute, expected.absolute, 1e-5 * expected.absolute);
}

}  // namespace
}  // namespace cohort
