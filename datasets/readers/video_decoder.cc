#include "datasets/readers/video_decoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/dict.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

constexpr double kDefaultFramesPerSecond = 30.0;  // if the file states none
constexpr double kLeastFramesPerSecond = 1e-3;    // rates beyond these are not valid for a video
constexpr double kMostFramesPerSecond = 1e6;
constexpr double kLongestSeconds = 1e9;  // 30 years, whose nanoseconds fit into 64 bits
// Consecutive faults after which a decoder counts as being at the end.
constexpr int kMostFaults = 4096;

// FFmpeg also opens lists of other files, and scripts that generate them, as videos: it would then
// read other files than the given one. Its own test reads the first MiB, so these marks, in any
// case, are searched for there.
bool NamesOtherFiles(const Descriptor& file) {
  constexpr std::array<std::string_view, 4> kMarks{
      "#extm3u", "ffconcat version", "dash:profile", "<compositionplaylist"};
  std::string start(1 << 20, '\0');
  const ssize_t n = pread(file.get(), start.data(), start.size(), 0);
  start.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
  for (char& c : start) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::ranges::any_of(
      kMarks, [&start](std::string_view mark) { return start.find(mark) != std::string::npos; });
}

// Called for another file to which the file refers.
int RefuseToOpen(AVFormatContext*, AVIOContext**, const char*, int, AVDictionary**) {
  return AVERROR(EACCES);
}

template <typename T>
T* Allocated(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

// The file itself may cause the request for too much memory.
void CheckMemory(int code, const std::string& name) {
  if (code == AVERROR(ENOMEM)) {
    ThrowError("cannot read {}: FFmpeg ran out of memory", name);
  }
}

// Cover art does not count.
std::optional<int> FirstVideo(const AVFormatContext& format) {
  constexpr int kNoVideo = AV_DISPOSITION_ATTACHED_PIC | AV_DISPOSITION_TIMED_THUMBNAILS;
  for (int i = 0; i < static_cast<int>(format.nb_streams); ++i) {
    const AVStream& stream = *format.streams[i];
    const bool video = stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO;
    if (video && (stream.disposition & kNoVideo) == 0) return i;
  }
  return std::nullopt;
}

void CheckPixels(int width_px, int height_px, const std::string& name) {
  if (std::int64_t{width_px} * height_px > VideoDecoder::kMaxPixels) {
    ThrowError("cannot read {}: its frames are {}x{}, but {} pixels are the maximum: scale it down",
               name,
               width_px,
               height_px,
               VideoDecoder::kMaxPixels);
  }
  if (std::max(width_px, height_px) > kMaxPictureSidePx) {
    ThrowError("cannot read {}: its frames are {}x{}, but {} pixels per side are the maximum",
               name,
               width_px,
               height_px,
               kMaxPictureSidePx);
  }
}

double RateOf(AVRational rate) {
  const double value = rate.den == 0 ? 0.0 : av_q2d(rate);
  return value >= kLeastFramesPerSecond && value <= kMostFramesPerSecond ? value : 0.0;
}

// Programs that copy videos spell the key differently.
std::string FocalLengthIn35mmFilmOf(const AVDictionary* metadata) {
  const AVDictionaryEntry* entry = nullptr;
  while ((entry = av_dict_get(metadata, "", entry, AV_DICT_IGNORE_SUFFIX)) != nullptr) {
    std::string key;
    for (const unsigned char c : std::string_view(entry->key)) {
      if (std::isalnum(c) != 0) key += static_cast<char>(std::tolower(c));
    }
    if (key.find("focallength") != std::string::npos && key.find("35mm") != std::string::npos) {
      return entry->value;
    }
  }
  return {};
}

// Width / height of a stored pixel.
double AspectOf(AVRational told) {
  constexpr double kNone = 0.02;  // nearer to 1 it is the rounding of a scaled size
  constexpr double kMost = 4.0;
  const double aspect = told.num > 0 && told.den > 0 ? av_q2d(told) : 1.0;
  const bool is_told = std::abs(aspect - 1.0) > kNone && aspect <= kMost && aspect >= 1.0 / kMost;
  return is_told ? aspect : 1.0;
}

// HDR by these filters, also as `ffmpeg -vf`: BT.2408's white of 203 cd/m2 becomes nearly that of
// sRGB, mobius compresses what is brighter (up to ten times) and changes nothing below 0.7 of it,
// and colours beyond BT.709's are clipped.
const std::string kToneMapping =
    "zscale=t=linear:npl=203:p=bt709,format=gbrpf32le,"
    "tonemap=mobius:param=0.7:desat=0:peak=10,zscale=t=iec61966-2-1,format=gbrp";

constexpr const char* kWithoutSubsampling = "format=yuv444p10le|yuv444p12le|gbrp10le|gbrp12le,";

// Every matrix that has the coefficients of BT.601, which is also FFmpeg's choice for a video that
// states none, of any size.
int MatrixOf(const AVFrame& frame) {
  const AVPixFmtDescriptor* kind = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  const bool has_matrix = kind != nullptr && (kind->flags & AV_PIX_FMT_FLAG_RGB) == 0;
  const int* const own = sws_getCoefficients(frame.colorspace);
  const bool is_default = std::equal(own, own + 4, sws_getCoefficients(SWS_CS_DEFAULT));
  return has_matrix && !is_default ? frame.colorspace : SWS_CS_DEFAULT;
}

// Applies to every stream, also while FFmpeg probes them.
class DecoderOptions {
 public:
  explicit DecoderOptions(unsigned streams) : options_(streams, nullptr) {
    for (AVDictionary*& option : options_) {
      av_dict_set_int(&option, "max_pixels", VideoDecoder::kMaxPixels, 0);
      av_dict_set_int(&option, "threads", 1, 0);
    }
  }
  DecoderOptions(const DecoderOptions&) = delete;
  DecoderOptions& operator=(const DecoderOptions&) = delete;
  ~DecoderOptions() {
    for (AVDictionary*& option : options_) av_dict_free(&option);
  }
  AVDictionary** data() { return options_.data(); }

 private:
  std::vector<AVDictionary*> options_;
};

}  // namespace

void VideoDecoder::Delete::operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
void VideoDecoder::Delete::operator()(AVFormatContext* format) const {
  avformat_close_input(&format);
}
void VideoDecoder::Delete::operator()(AVFrame* frame) const { av_frame_free(&frame); }
void VideoDecoder::Delete::operator()(AVIOContext* io) const {
  av_freep(&io->buffer);
  avio_context_free(&io);
}
void VideoDecoder::Delete::operator()(AVPacket* packet) const { av_packet_free(&packet); }
void VideoDecoder::Delete::operator()(SwsContext* converter) const { sws_freeContext(converter); }

int VideoDecoder::Read(void* source, std::uint8_t* bytes, int count) {
  auto& from = *static_cast<Source*>(source);
  ssize_t n = 0;
  do {
    n = read(from.file.get(), bytes, static_cast<std::size_t>(count));
  } while (n < 0 && errno == EINTR);
  if (n < 0) {
    from.error = errno;
    return AVERROR(errno);
  }
  return n == 0 ? AVERROR_EOF : static_cast<int>(n);
}

std::int64_t VideoDecoder::Seek(void* source, std::int64_t offset, int whence) {
  const int fd = static_cast<const Source*>(source)->file.get();
  if ((whence & AVSEEK_SIZE) != 0) {
    const off_t here = lseek(fd, 0, SEEK_CUR);
    const off_t size = lseek(fd, 0, SEEK_END);
    lseek(fd, here, SEEK_SET);
    return size;
  }
  const off_t place = lseek(fd, offset, whence & ~AVSEEK_FORCE);
  return place < 0 ? AVERROR(errno) : place;
}

VideoDecoder::VideoDecoder(const std::filesystem::path& file,
                           std::optional<FieldOrder> deinterlaced)
    : name_(file.string()),
      source_{OpenInputDescriptor(file)},
      packet_(Allocated(av_packet_alloc())),
      frame_(Allocated(av_frame_alloc())),
      tone_mapped_(Allocated(av_frame_alloc())),
      deinterlaced_(deinterlaced) {
  av_log_set_level(AV_LOG_QUIET);  // our own errors and warnings suffice
  if (NamesOtherFiles(source_.file)) {
    ThrowError("{} is a list of other files: give the video that it refers to", name_);
  }
  OpenFile();
  OpenStream();
}

VideoDecoder::~VideoDecoder() = default;

void VideoDecoder::CheckSource() const {
  if (source_.error == 0) return;
  throw SystemError(fmt::format("cannot read {}: {}", name_, std::strerror(source_.error)));
}

void VideoDecoder::OpenFile() {
  constexpr int kBufferBytes = 1 << 16;
  auto* buffer = static_cast<unsigned char*>(Allocated(av_malloc(kBufferBytes)));
  io_.reset(avio_alloc_context(buffer, kBufferBytes, 0, &source_, Read, nullptr, Seek));
  if (!io_) {
    av_free(buffer);
    throw std::bad_alloc();
  }
  AVFormatContext* format = Allocated(avformat_alloc_context());
  format->pb = io_.get();
  format->io_open = RefuseToOpen;
  format->protocol_whitelist = av_strdup("");
  const int opened = avformat_open_input(&format, "", nullptr, nullptr);  // frees it if it fails
  CheckMemory(opened, name_);
  if (opened >= 0) {
    format_.reset(format);
    // FFmpeg discards a size that it does not accept.
    if (const auto stream = FirstVideo(*format)) {
      const AVCodecParameters& parameters = *format->streams[*stream]->codecpar;
      CheckPixels(parameters.width, parameters.height, name_);
    }
    CheckMemory(avformat_find_stream_info(format, DecoderOptions(format->nb_streams).data()),
                name_);
    stream_ = FirstVideo(*format).value_or(-1);
    for (int i = 0; i < static_cast<int>(format->nb_streams); ++i) {
      format->streams[i]->discard = i == stream_ ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
    }
  }
  CheckSource();
  if (stream_ < 0) {
    ThrowError("cannot open {} as a video: FFmpeg finds no video in it ({})",
               name_,
               format_ != nullptr && format_->nb_streams > 0
                   ? "only sound, a cover or text"
                   : "a truncated MP4 has lost its index");
  }
}

void VideoDecoder::OpenStream() {
  AVStream& stream = *format_->streams[stream_];
  const AVCodecParameters& parameters = *stream.codecpar;
  pixel_aspect_ = AspectOf(av_guess_sample_aspect_ratio(format_.get(), &stream, nullptr));
  CheckPixels(parameters.width, parameters.height, name_);
  CheckPixels(ShownWidth(parameters.width), parameters.height, name_);
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    ThrowError("cannot open {} as a video: FFmpeg has no decoder of its codec, {}",
               name_,
               avcodec_get_name(parameters.codec_id));
  }
  codec_.reset(Allocated(avcodec_alloc_context3(decoder)));
  CheckMemory(avcodec_parameters_to_context(codec_.get(), &parameters), name_);
  codec_->pkt_timebase = stream.time_base;
  const int opened = avcodec_open2(codec_.get(), decoder, DecoderOptions(1).data());
  CheckMemory(opened, name_);
  if (opened < 0) {
    ThrowError(
        "cannot open {} as a video: FFmpeg's decoder {} does not accept it", name_, decoder->name);
  }

  frames_per_second_ = RateOf(stream.avg_frame_rate);
  if (frames_per_second_ == 0.0) frames_per_second_ = RateOf(stream.r_frame_rate);
  if (frames_per_second_ == 0.0) frames_per_second_ = kDefaultFramesPerSecond;
  if (stream.time_base.den != 0) seconds_per_tick_ = av_q2d(stream.time_base);

  // It maps (x, y) to (a x + c y, b x + d y). Pictures can only be rotated by quarter turns; other
  // rotations are rounded to the nearest one.
  std::size_t bytes = 0;
  const auto* matrix = reinterpret_cast<const std::int32_t*>(
      av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &bytes));
  if (matrix != nullptr && bytes >= 9 * sizeof(std::int32_t)) {
    const std::int64_t a = matrix[0];
    const std::int64_t b = matrix[1];
    const std::int64_t c = matrix[3];
    const std::int64_t d = matrix[4];
    const bool transposed = std::abs(b) + std::abs(c) > std::abs(a) + std::abs(d);
    orientation_ = {transposed, (transposed ? c : a) < 0, (transposed ? b : d) < 0};
  }
}

RowOrder VideoDecoder::SensorRows() const {
  if (orientation_.transposed) {
    return orientation_.mirrored_x ? RowOrder::kLeft : RowOrder::kRight;
  }
  return orientation_.mirrored_y ? RowOrder::kUp : RowOrder::kDown;
}

std::string VideoDecoder::FocalLengthIn35mmFilm() const {
  const std::string of_stream = FocalLengthIn35mmFilmOf(format_->streams[stream_]->metadata);
  return of_stream.empty() ? FocalLengthIn35mmFilmOf(format_->metadata) : of_stream;
}

int VideoDecoder::ShownWidth(int stored_width_px) const {
  return std::max(1, static_cast<int>(std::lround(pixel_aspect_ * stored_width_px)));
}

bool VideoDecoder::CountsFrames() const { return format_->streams[stream_]->nb_frames > 0; }

bool VideoDecoder::HasOtherStreams() const { return format_->nb_streams > 1; }

double VideoDecoder::SecondsLeft() const {
  if (format_->duration == AV_NOPTS_VALUE) return 0.0;
  // Some durations count from the first frame's time, others from zero, in which case less remains.
  const double first =
      first_tick_ ? std::max(0.0, static_cast<double>(*first_tick_) * seconds_per_tick_) : 0.0;
  const double end = first + seconds_ + 1.0 / frames_per_second_;
  return std::max(0.0, static_cast<double>(format_->duration) / AV_TIME_BASE - end);
}

std::optional<std::size_t> VideoDecoder::PromisedFrames() const {
  const AVStream& stream = *format_->streams[stream_];
  double frames = static_cast<double>(stream.nb_frames);
  const bool may_have_edits =
      std::string_view(format_->iformat->name).find("mp4") != std::string_view::npos;
  if (CountsFrames() && may_have_edits && stream.duration > 0) {
    // An edit list hides some frames of a clip that was cut out without re-encoding.
    const double seconds = static_cast<double>(stream.duration) * seconds_per_tick_;
    constexpr double kRounding = 0.01;
    frames = std::min(frames, std::floor(seconds * frames_per_second_ + kRounding));
  }
  if (!CountsFrames() && format_->duration != AV_NOPTS_VALUE) {
    const double seconds = static_cast<double>(format_->duration) / AV_TIME_BASE;
    frames = std::round(seconds * frames_per_second_);
  }
  if (!(frames >= 1.0 && frames < 1e9)) return std::nullopt;
  return static_cast<std::size_t>(frames);
}

void VideoDecoder::Send() {
  for (int faults = 0; faults < kMostFaults;) {
    const int read = av_read_frame(format_.get(), packet_.get());
    CheckMemory(read, name_);
    CheckSource();  // also if FFmpeg continues: its packet is not what the file contains
    if (read == AVERROR(EAGAIN)) {
      ++faults;
      continue;
    }
    if (read < 0) break;
    const bool ours = packet_->stream_index == stream_;
    // A damaged packet gives no frame.
    if (ours) CheckMemory(avcodec_send_packet(codec_.get(), packet_.get()), name_);
    av_packet_unref(packet_.get());
    if (ours) return;
  }
  avcodec_send_packet(codec_.get(), nullptr);
}

bool VideoDecoder::Next() {
  tone_mapped_current_ = false;
  color_.current = false;
  luma_.current = false;
  alpha_.current = false;
  if (!(deinterlaced_ ? Deinterlace() : Decode())) return false;
  Stamp();
  return true;
}

bool VideoDecoder::Decode() {
  for (int faults = 0; faults < kMostFaults;) {
    const int received = avcodec_receive_frame(codec_.get(), frame_.get());
    CheckMemory(received, name_);
    if (received == AVERROR_EOF) break;
    if (received == AVERROR(EAGAIN)) {
      Send();
    } else if (received < 0) {
      ++faults;
    } else {
      return true;
    }
  }
  return false;
}

// A frame's lines are seen again in the frames before and after it, so that each frame comes out
// when the next one has been decoded.
bool VideoDecoder::Deinterlace() {
  while (!deinterlacer_ || !deinterlacer_->Pull(*frame_)) {
    if (!Decode()) {
      if (!deinterlacer_) return false;
      deinterlacer_->Finish();
      return deinterlacer_->Pull(*frame_);
    }
    if (!deinterlacer_) {
      const char* const order = *deinterlaced_ == FieldOrder::kTopFirst ? "tff" : "bff";
      deinterlacer_.emplace(*frame_, fmt::format("bwdif=mode=send_frame:parity={}", order), name_);
    }
    if (!deinterlacer_->Accepts(*frame_)) {
      ThrowError(
          "cannot read {}: it is interlaced, and its frames change to {}x{} or to other pixels",
          name_,
          frame_->width,
          frame_->height);
    }
    deinterlacer_->Push(*frame_);
  }
  return true;
}

std::string_view VideoDecoder::Hdr() const {
  if (frame_->color_trc == AVCOL_TRC_ARIB_STD_B67) return "HLG";
  if (frame_->color_trc == AVCOL_TRC_SMPTE2084) return "PQ";
  return "";
}

std::optional<FieldOrder> VideoDecoder::FlaggedFieldOrder() const {
  if (frame_->interlaced_frame != 0) {
    return frame_->top_field_first != 0 ? FieldOrder::kTopFirst : FieldOrder::kBottomFirst;
  }
  // Some codecs store no such flag, but their containers do. The second letter is the one shown
  // first.
  const AVFieldOrder order = format_->streams[stream_]->codecpar->field_order;
  if (order == AV_FIELD_TT || order == AV_FIELD_BT) return FieldOrder::kTopFirst;
  if (order == AV_FIELD_BB || order == AV_FIELD_TB) return FieldOrder::kBottomFirst;
  return std::nullopt;
}

void VideoDecoder::Stamp() {
  const std::int64_t tick = frame_->best_effort_timestamp;
  if (!decoded_any_) {
    decoded_any_ = true;
    if (tick != AV_NOPTS_VALUE) first_tick_ = tick;
    return;
  }
  double seconds = 0.0;
  if (first_tick_ && tick != AV_NOPTS_VALUE) {
    seconds = (static_cast<double>(tick) - static_cast<double>(*first_tick_)) * seconds_per_tick_;
  }
  const bool later = seconds > seconds_ && seconds <= kLongestSeconds;
  seconds_ = later ? seconds : std::min(seconds_ + 1.0 / frames_per_second_, kLongestSeconds);
}

const AVFrame& VideoDecoder::Shown() {
  if (Hdr().empty()) return *frame_;
  if (!tone_mapped_current_) {
    // What HDR video has if it does not state it, without which zscale refuses it.
    if (frame_->color_primaries == AVCOL_PRI_UNSPECIFIED) {
      frame_->color_primaries = AVCOL_PRI_BT2020;
    }
    if (frame_->colorspace == AVCOL_SPC_UNSPECIFIED) frame_->colorspace = AVCOL_SPC_BT2020_NCL;
    if (!tone_mapper_ || !tone_mapper_->Accepts(*frame_)) {
      // zscale does not accept subsampled colours of odd sizes.
      const bool odd = (frame_->width | frame_->height) % 2 != 0;
      tone_mapper_.emplace(*frame_, (odd ? kWithoutSubsampling : "") + kToneMapping, name_);
    }
    tone_mapper_->Push(*frame_);
    tone_mapped_current_ = tone_mapper_->Pull(*tone_mapped_);
    if (!tone_mapped_current_) ThrowError("cannot read {}: FFmpeg cannot tone-map its HDR", name_);
  }
  return *tone_mapped_;
}

void VideoDecoder::MakeConverter(const AVFrame& frame, int matrix, Converter& converter) const {
  // JPEG's formats (yuvj420p) imply the full range.
  const bool full_range = frame.color_range == AVCOL_RANGE_JPEG;
  if (converter.context && converter.width_px == frame.width &&
      converter.height_px == frame.height && converter.pixel_format == frame.format &&
      converter.full_range == full_range && converter.matrix == matrix) {
    return;
  }
  converter.bgr.reset(Allocated(av_frame_alloc()));
  AVFrame& bgr = *converter.bgr;
  bgr.format = converter.with_alpha ? AV_PIX_FMT_BGRA : AV_PIX_FMT_BGR24;
  bgr.width = ShownWidth(frame.width);
  bgr.height = frame.height;
  CheckMemory(av_frame_get_buffer(&bgr, 0), name_);
  converter.context.reset(Allocated(sws_alloc_context()));
  SwsContext* const context = converter.context.get();
  for (const auto& [option, value] : {std::pair("srcw", frame.width),
                                      std::pair("srch", frame.height),
                                      std::pair("src_format", frame.format),
                                      std::pair("src_range", full_range ? 1 : 0),
                                      std::pair("dstw", bgr.width),
                                      std::pair("dsth", frame.height),
                                      std::pair("dst_format", bgr.format),
                                      std::pair("sws_flags", SWS_BICUBIC)}) {
    av_opt_set_int(context, option, value, 0);
  }
  bool made = sws_init_context(context, nullptr, nullptr) >= 0;
  if (made && matrix != SWS_CS_DEFAULT) {
    int* table = nullptr;  // of the picture, whose range and the others stay
    int* own_table = nullptr;
    int range = 0;
    int own_range = 0;
    int brightness = 0;
    int contrast = 0;
    int saturation = 0;
    made =
        sws_getColorspaceDetails(
            context, &own_table, &own_range, &table, &range, &brightness, &contrast, &saturation) >=
            0 &&
        sws_setColorspaceDetails(context,
                                 sws_getCoefficients(matrix),
                                 own_range,
                                 table,
                                 range,
                                 brightness,
                                 contrast,
                                 saturation) >= 0;
  }
  if (!made) {
    const char* kind = av_get_pix_fmt_name(static_cast<AVPixelFormat>(frame.format));
    ThrowError("cannot read {}: FFmpeg cannot convert its frames, {}x{} of {}",
               name_,
               frame.width,
               frame.height,
               kind == nullptr ? "an unknown pixel format" : kind);
  }
  converter.width_px = frame.width;
  converter.height_px = frame.height;
  converter.pixel_format = frame.format;
  converter.full_range = full_range;
  converter.matrix = matrix;
}

cv::Mat VideoDecoder::Convert(const AVFrame& frame, int matrix, Converter& converter) const {
  if (!converter.current) {
    MakeConverter(frame, matrix, converter);
    sws_scale(converter.context.get(),
              frame.data,
              frame.linesize,
              0,
              frame.height,
              converter.bgr->data,
              converter.bgr->linesize);
    converter.current = true;
  }
  const AVFrame& bgr = *converter.bgr;
  return {bgr.height,
          bgr.width,
          converter.with_alpha ? CV_8UC4 : CV_8UC3,
          bgr.data[0],
          static_cast<std::size_t>(bgr.linesize[0])};
}

cv::Mat VideoDecoder::Picture() {
  const AVFrame& frame = Shown();
  const cv::Mat color = Convert(frame, MatrixOf(frame), color_);
  const cv::Mat alpha = Alpha(frame);
  if (alpha.empty()) return Upright(color);
  cv::Mat picture(color.size(), CV_8UC4);
  const cv::Mat from[] = {color, alpha};
  const int channels[] = {0, 0, 1, 1, 2, 2, 3, 3};
  cv::mixChannels(from, 2, &picture, 1, channels, 4);
  return Upright(picture);
}

// Apart from the colours, which are then the same as without alpha, to the last bit.
cv::Mat VideoDecoder::Alpha(const AVFrame& frame) {
  const AVPixFmtDescriptor* const kind =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  if (kind == nullptr || (kind->flags & AV_PIX_FMT_FLAG_ALPHA) == 0) return {};
  alpha_.with_alpha = true;
  cv::Mat alpha;
  cv::extractChannel(Convert(frame, SWS_CS_DEFAULT, alpha_), alpha, 3);
  double least = 0.0;
  double most = 0.0;
  cv::minMaxLoc(alpha, &least, &most);
  if (least == most) return {};
  return alpha;
}

// OpenCV makes grey with the weights of BT.601: by this matrix every frame's grey is its luma.
cv::Mat VideoDecoder::Gray() {
  const AVFrame& frame = Shown();
  Converter& converter = MatrixOf(frame) == SWS_CS_DEFAULT ? color_ : luma_;
  cv::Mat gray;
  cv::cvtColor(Convert(frame, SWS_CS_DEFAULT, converter), gray, cv::COLOR_BGR2GRAY);
  return Upright(gray);
}

cv::Mat VideoDecoder::Upright(const cv::Mat& stored) const {
  cv::Mat picture;
  if (orientation_.transposed) {
    cv::transpose(stored, picture);
  } else {
    stored.copyTo(picture);
  }
  if (orientation_.mirrored_x && orientation_.mirrored_y) {
    cv::flip(picture, picture, -1);
  } else if (orientation_.mirrored_x) {
    cv::flip(picture, picture, 1);
  } else if (orientation_.mirrored_y) {
    cv::flip(picture, picture, 0);
  }
  return picture;
}

}  // namespace cohort
