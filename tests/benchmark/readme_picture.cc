// Writes the picture on top of the README: a dark frame as it is, and brightened with the tracks of
// two trackers: green where they are within 1 px of the truth, yellow within 3 px, red beyond.
//   cohort synth clip --scene street --motion lateral --frames 60 --seed 11
//   cohort degrade clip dark --level hard
//   cohort track dark --features 400 --tracker klt --klt.window-px 31 --out klt.tracks
//   cohort track dark --features 400 --out cohort.tracks
//   readme_picture dark 50 klt.tracks cohort.tracks docs/tracks_in_the_dark.jpg
// And the animation under it, of frames 20 to 49 tracked by themselves (--frames 20:50):
//   cohort show klt.tracks cohort.tracks --width-px 300 --frames-per-second 10 --out docs/tracks_in_the_dark.gif

#include <fmt/format.h>

#include <cstdlib>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "datasets/open_sequence.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/report/brightening.h"
#include "pipelines/report/track_picture.h"

namespace cohort {
namespace {

constexpr int kCaptionPx = 56;

// The picture under two lines of text.
cv::Mat Captioned(const cv::Mat& picture, const std::string& title, const std::string& line) {
  cv::Mat panel(picture.rows + kCaptionPx, picture.cols, CV_8UC3, cv::Scalar::all(255));
  picture.copyTo(panel(cv::Rect(0, kCaptionPx, picture.cols, picture.rows)));
  cv::putText(
      panel, title, {4, 22}, cv::FONT_HERSHEY_DUPLEX, 0.75, cv::Scalar::all(20), 1, cv::LINE_AA);
  cv::putText(
      panel, line, {4, 46}, cv::FONT_HERSHEY_DUPLEX, 0.55, cv::Scalar::all(90), 1, cv::LINE_AA);
  return panel;
}

cv::Mat Panel(const Frame& frame,
              const std::string& title,
              const std::string& path,
              TrackTruth* truth) {
  const TrackSet tracks = ReadTrackFile(path).tracks;
  std::vector<double> ages;  // frames since the first one, of what is observed
  for (const Observation* o : tracks.InFrame(frame.index)) {
    if (o->state != ObservationState::kObserved) continue;
    ages.push_back(ToInt(frame.index) - ToInt(tracks.Track(o->feature).front().frame));
  }
  const TrackPicture drawn =
      DrawTracks(Brightened(frame.gray, IntensityRangeOf(frame.gray)), frame.index, tracks, truth);
  return Captioned(drawn.picture,
                   title,
                   fmt::format("{} points seen, half of them for {:.0f} frames or more",
                               drawn.observed,
                               Median(std::move(ages))));
}

void Write(const std::string& clip,
           int index,
           const std::string& klt,
           const std::string& cohort,
           const std::string& out) {
  const auto sequence = OpenSequence(clip);
  const auto truth = OpenTrackTruth(*sequence, clip);
  std::optional<Frame> frame = sequence->Next();
  while (frame && static_cast<int>(ToInt(frame->index)) < index) frame = sequence->Next();
  if (!frame) ThrowError("{}: has no frame {}", clip, index);
  cv::Mat recorded;
  cv::cvtColor(frame->gray, recorded, cv::COLOR_GRAY2BGR);
  cv::Mat picture;
  const std::vector<cv::Mat> panels{
      Captioned(recorded, "One frame of the video", "20 % of the light, noise, a blur of 2 px"),
      Panel(*frame, "KLT, 31 px", klt, truth.get()),
      Panel(*frame, "cohort", cohort, truth.get())};
  cv::hconcat(panels, picture);
  cv::resize(picture, picture, {}, 0.625, 0.625, cv::INTER_AREA);
  if (!cv::imwrite(out, picture, {cv::IMWRITE_JPEG_QUALITY, 82})) {
    ThrowError("cannot write {}", out);
  }
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  if (argc != 6) {
    std::cerr << "usage: readme_picture CLIP FRAME KLT.tracks COHORT.tracks OUT.jpg\n";
    return 2;
  }
  try {
    cohort::Write(argv[1], std::atoi(argv[2]), argv[3], argv[4], argv[5]);
  } catch (const std::exception& error) {
    std::cerr << "readme_picture: error: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
