#include "datasets/readers/video_filter.h"

extern "C" {
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavutil/frame.h>
}

#include <new>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {

void VideoFilter::Delete::operator()(AVFilterGraph* graph) const { avfilter_graph_free(&graph); }

VideoFilter::VideoFilter(const AVFrame& like, std::string chain, std::string file)
    : chain_(std::move(chain)),
      file_(std::move(file)),
      width_px_(like.width),
      height_px_(like.height),
      pixel_format_(like.format),
      graph_(avfilter_graph_alloc()) {
  if (!graph_) throw std::bad_alloc();
  graph_->nb_threads = 1;
  // The frames keep their own times, which no filter of ours reads.
  const std::string text =
      fmt::format("buffer@in=video_size={}x{}:pix_fmt={}:time_base=1/1000,{},buffersink@out",
                  width_px_,
                  height_px_,
                  pixel_format_,
                  chain_);
  AVFilterInOut* open_inputs = nullptr;
  AVFilterInOut* open_outputs = nullptr;
  const int parsed = avfilter_graph_parse2(graph_.get(), text.c_str(), &open_inputs, &open_outputs);
  avfilter_inout_free(&open_inputs);
  avfilter_inout_free(&open_outputs);
  Check(parsed);
  Check(avfilter_graph_config(graph_.get(), nullptr));
  source_ = avfilter_graph_get_filter(graph_.get(), "buffer@in");
  sink_ = avfilter_graph_get_filter(graph_.get(), "buffersink@out");
  if (source_ == nullptr || sink_ == nullptr) Check(AVERROR(EINVAL));
}

bool VideoFilter::Accepts(const AVFrame& frame) const {
  return frame.width == width_px_ && frame.height == height_px_ && frame.format == pixel_format_;
}

void VideoFilter::Push(const AVFrame& frame) { Check(av_buffersrc_write_frame(source_, &frame)); }

void VideoFilter::Finish() { Check(av_buffersrc_write_frame(source_, nullptr)); }

bool VideoFilter::Pull(AVFrame& frame) {
  av_frame_unref(&frame);
  const int pulled = av_buffersink_get_frame(sink_, &frame);
  if (pulled == AVERROR(EAGAIN) || pulled == AVERROR_EOF) return false;
  Check(pulled);
  return true;
}

void VideoFilter::Check(int code) const {
  if (code >= 0) return;
  if (code == AVERROR(ENOMEM)) ThrowError("cannot read {}: FFmpeg ran out of memory", file_);
  ThrowError("cannot read {}: FFmpeg's filters '{}' do not accept its frames, {}x{}",
             file_,
             chain_,
             width_px_,
             height_px_);
}

}  // namespace cohort
