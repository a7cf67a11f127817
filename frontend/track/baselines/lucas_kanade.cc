#include "frontend/track/baselines/lucas_kanade.h"

#include <opencv2/video/tracking.hpp>

#include "frontend/track/baselines/frame_to_frame.h"

namespace cohort {

std::vector<cv::Mat> LkPyramid(const Pyramid& picture, int window_px, int max_level) {
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(
      EightBit(picture), pyramid, cv::Size(window_px, window_px), max_level);
  return pyramid;
}

LkResult TrackByLk(const std::vector<cv::Mat>& from,
                   const std::vector<cv::Mat>& to,
                   const std::vector<cv::Point2f>& starts,
                   int window_px,
                   int max_level,
                   const std::vector<cv::Point2f>& guesses) {
  LkResult result{guesses, {}};
  if (starts.empty()) return result;
  cv::calcOpticalFlowPyrLK(
      from,
      to,
      starts,
      result.ends,
      result.found,
      cv::noArray(),
      cv::Size(window_px, window_px),
      max_level,
      cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01),
      guesses.empty() ? 0 : cv::OPTFLOW_USE_INITIAL_FLOW);
  return result;
}

LkResult TrackThereAndBack(const std::vector<cv::Mat>& from,
                           const std::vector<cv::Mat>& to,
                           const std::vector<cv::Point2f>& starts,
                           int window_px,
                           int max_level,
                           double return_px,
                           const std::vector<cv::Point2f>& guesses) {
  LkResult there = TrackByLk(from, to, starts, window_px, max_level, guesses);
  const LkResult back = TrackByLk(to,
                                  from,
                                  there.ends,
                                  window_px,
                                  max_level,
                                  guesses.empty() ? std::vector<cv::Point2f>() : starts);
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const bool returned = back.found[i] != 0 && cv::norm(back.ends[i] - starts[i]) <= return_px;
    there.found[i] = there.found[i] != 0 && returned ? 1 : 0;
  }
  return there;
}

}  // namespace cohort
