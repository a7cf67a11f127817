#pragma once

#include <memory>
#include <string>

struct AVFilterContext;
struct AVFilterGraph;
struct AVFrame;

namespace cohort {

// A chain of FFmpeg's filters (libavfilter), as `ffmpeg -vf` takes it, for frames of one size and
// pixel format. Runs on one thread.
//
//   VideoFilter filter(frame, "bwdif", file);
//   filter.Push(frame);                  // for each frame; Finish() after the last one
//   while (filter.Pull(out)) Use(out);   // after each of them
class VideoFilter {
 public:
  // For frames like this one. `file` is for the errors. This and the others throw Error if the
  // filters do not accept the frames.
  VideoFilter(const AVFrame& like, std::string chain, std::string file);

  bool Accepts(const AVFrame& frame) const;  // has the size and the pixel format
  void Push(const AVFrame& frame);
  void Finish();
  // Replaces `frame` by the next filtered one. Returns false if there is none yet, or none left.
  bool Pull(AVFrame& frame);

 private:
  struct Delete {
    void operator()(AVFilterGraph* graph) const;
  };

  void Check(int code) const;

  std::string chain_;
  std::string file_;
  int width_px_;
  int height_px_;
  int pixel_format_;
  std::unique_ptr<AVFilterGraph, Delete> graph_;
  AVFilterContext* source_ = nullptr;  // the graph's
  AVFilterContext* sink_ = nullptr;
};

}  // namespace cohort
