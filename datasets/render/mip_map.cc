#include "datasets/render/mip_map.h"

#include <opencv2/imgproc.hpp>

#include "frontend/core/error.h"

namespace cohort {

MipMap::MipMap(const cv::Mat& texture) {
  Check(texture.type() == CV_32FC1 && texture.cols >= 4 && texture.rows >= 4,
        "a texture is CV_32FC1, at least 4x4");
  levels_.emplace_back(texture);
  do {
    cv::Mat half;
    // Averages areas exactly, also if a side is odd, so that nothing shifts.
    cv::resize(levels_.back().texels,
               half,
               cv::Size((levels_.back().texels.cols + 1) / 2, (levels_.back().texels.rows + 1) / 2),
               0,
               0,
               cv::INTER_AREA);
    levels_.emplace_back(half);
  } while (std::min(levels_.back().texels.cols, levels_.back().texels.rows) >= 4);
}

}  // namespace cohort
