// The module _cohort, which implements the Python package cohort (cohort/__init__.py). Options are
// passed as JSON with the names that `--dump-config` prints, results as arrays.

#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "backend/colmap/colmap_tracks.h"
#include "backend/colmap/model_io.h"
#include "backend/colmap/tracks_to_database.h"
#include "datasets/readers/image_folder.h"
#include "frontend/core/interruption.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/frame_name.h"
#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/json/option_list.h"
#include "pipelines/python/arrays.h"
#include "pipelines/python/frames.h"
#include "pipelines/python/gil.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/kept_frames.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/track_sequence.h"
#include "pipelines/sfm/version.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

// The options of `cohort track`, except for the files that it reads and writes.
struct TrackArguments {
  InputOptions input;
  MaskOptions masks;
  int threads = 0;
  TrackerOptions tracker;
  SecondPassOptions second_pass;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.input, v);
    MaskOptions::Visit(o.masks, v);
    v.Number("threads", o.threads, 0, 1024, "as in `cohort track`");
    TrackerOptions::Visit(o.tracker, v);
    v.Group("second_pass", o.second_pass, "the second pass");
  }
};

// The options of `cohort refine`, except for the files.
struct RefineArguments {
  SecondPassOptions second_pass;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    SecondPassOptions::VisitMeasurement(o.second_pass, v);
  }
};

template <typename Options>
Options FromJsonText(const std::string& json, const std::string& function) {
  Options options;
  try {
    SetFromJson(ListOptions(options), Json::parse(json), function);
  } catch (const Json::exception& e) {  // names that are not text, numbers out of range
    ThrowUsageError("{}: the options cannot be represented as JSON ({})", function, e.what());
  }
  return options;
}

template <typename Options>
std::string DefaultsAsJsonText() {
  return ToJson(Options{}).dump();
}

std::string DefaultOptions(const std::string& function) {
  if (function == "track") return DefaultsAsJsonText<TrackArguments>();
  if (function == "reconstruct") return DefaultsAsJsonText<ReconstructOptions>();
  if (function == "refine") return DefaultsAsJsonText<RefineArguments>();
  if (function == "write_colmap_database") return DefaultsAsJsonText<ColmapDatabaseOptions>();
  ThrowUsageError("default_options('{}'): give track, reconstruct, refine or write_colmap_database",
                  function);
}

// Like os.fsdecode: names of files may contain any bytes, so bytes that are not UTF-8 become
// surrogates.
py::str ToStr(const std::string& text) {
  PyObject* const decoded =
      PyUnicode_DecodeFSDefaultAndSize(text.data(), static_cast<py::ssize_t>(text.size()));
  if (decoded == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(decoded);
}

// While an instance lives, OpenCV has the requested number of threads; 0: unchanged. If several
// calls run at once, the latest request counts, and the last one to end restores the number from
// before all of them.
class ThreadsOfOpenCv {
 public:
  explicit ThreadsOfOpenCv(int threads) {
    const std::lock_guard lock(mutex);
    if (alive++ == 0) before = cv::getNumThreads();
    if (threads > 0) cv::setNumThreads(threads);
  }
  ThreadsOfOpenCv(const ThreadsOfOpenCv&) = delete;
  ThreadsOfOpenCv& operator=(const ThreadsOfOpenCv&) = delete;
  ~ThreadsOfOpenCv() {
    const std::lock_guard lock(mutex);
    if (--alive == 0 && cv::getNumThreads() != before) cv::setNumThreads(before);
  }

 private:
  static inline std::mutex mutex;
  static inline int alive = 0;
  static inline int before = 0;
};

// Throws KeyboardInterrupt after Ctrl-C, or whatever else a signal's handler raises. It may be
// called at any rate: it asks Python, which other threads may keep busy, at most a hundred times a
// second.
void RaiseOfSignals() {
  static thread_local std::chrono::steady_clock::time_point asked;
  const auto now = std::chrono::steady_clock::now();
  if (now - asked < std::chrono::milliseconds(10)) return;
  asked = now;
  if (CallWithoutGil::MustEnd()) ThrowError("the interpreter exits");
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

// The result is to be called without the GIL. `callback`: progress(stage, done, total or None), or
// None.
StageProgress ProgressTo(const py::object& callback) {
  return [&callback](std::string_view stage, std::size_t done, std::optional<std::size_t> total) {
    RaiseOfSignals();
    const py::gil_scoped_acquire gil;
    if (!callback.is_none()) callback(stage, done, total);
  };
}

// An INPUT, or an iterable of arrays.
using ClipArgument = std::variant<fs::path, py::object>;

std::unique_ptr<Sequence> OpenArrays(const ClipArgument& clip, bool rgb, bool keep) {
  const auto* frames = std::get_if<py::object>(&clip);
  return frames == nullptr ? nullptr : SequenceOfArrays(*frames, rgb, keep);
}

ClipMasks MasksOf(const std::optional<py::object>& array, const std::string& path) {
  if (!array) return ClipMasks(path);
  cv::Mat mask = GrayOfArray(*array, false, "the mask");
  if (mask.depth() != CV_8U) mask = mask > 0;
  CheckMaskIsOpen(mask, "the mask");
  return {mask, "array"};
}

TrackFile Track(const ClipArgument& clip,
                const std::string& options,
                bool rgb,
                const std::optional<py::object>& mask_array,
                const std::optional<Camera>& camera,
                const py::object& callback) {
  TrackArguments arguments = FromJsonText<TrackArguments>(options, "track()");
  // Before all the work.
  if (GivenCamera(arguments.input, 0, 0) && camera) {
    ThrowUsageError("a Camera and another camera, as text or a prior, are given: give one of them");
  }
  const bool second_pass = WantsSecondPass(arguments.second_pass.mode, arguments.tracker);
  ClipMasks masks = MasksOf(mask_array, arguments.masks.mask);
  std::unique_ptr<Sequence> sequence = OpenArrays(clip, rgb, second_pass);
  const StageProgress progress = ProgressTo(callback);

  const CallWithoutGil no_gil;
  const InterruptionCheck interruption(RaiseOfSignals);
  const ThreadsOfOpenCv threads(arguments.threads);
  // Destroyed without the GIL, for which the thread that reads ahead may be waiting.
  std::unique_ptr<Sequence> opened = [&] {
    if (sequence) return std::move(sequence);
    arguments.input.input = std::get<fs::path>(clip).string();
    return KeepFrames(OpenInput(arguments.input));
  }();
  const bool find = arguments.masks.mask_fixed && !arguments.input.input.empty();
  MaskedSequence masked(std::move(opened),
                        std::move(masks),
                        arguments.input.frames.empty(),
                        find ? FixedPartsMask::kFind : FixedPartsMask::kNone);
  TrackFile file = TrackFirstPass(masked,
                                  {.tracker = arguments.tracker,
                                   .second_pass = arguments.second_pass,
                                   .camera = camera,
                                   .source = arguments.input.input},
                                  progress);
  DescribeInput(arguments.input, masked, file);
  file.meta.program = fmt::format("cohort {}", kVersion);
  NoteMask(arguments.masks.mask, file);
  NoteFixedParts(arguments.masks, masked, file);
  if (camera) NoteCamera(camera, file);  // instead of the clip's own
  if (second_pass) {
    file = WithSecondPass(std::move(file), masked, arguments.second_pass, progress).file;
  }
  file.meta.warning = WarningOfClip(masked, file, arguments.input.input);
  return file;
}

// The tracks and the doubts about them. Without a clip, uses the one that `file` names.
std::pair<TrackFile, std::vector<std::string>> Refine(const TrackFile& file,
                                                      const Reconstruction& model,
                                                      const std::optional<ClipArgument>& clip,
                                                      const std::string& options,
                                                      bool rgb,
                                                      const std::optional<py::object>& mask_array,
                                                      const fs::path& mask_path,
                                                      const py::object& callback) {
  constexpr const char* kTracks = "this Tracks object";
  const auto arguments = FromJsonText<RefineArguments>(options, "refine()");
  const bool as_before = mask_path.empty();
  const std::string mask_name = as_before ? file.meta.mask : mask_path.string();
  ClipMasks masks = MasksOf(mask_array, mask_name);
  std::unique_ptr<Sequence> sequence = clip ? OpenArrays(*clip, rgb, true) : nullptr;
  const StageProgress progress = ProgressTo(callback);

  const CallWithoutGil no_gil;
  const InterruptionCheck interruption(RaiseOfSignals);
  std::vector<std::string> doubts = {DoubtOfModel(model, "this Reconstruction", file, kTracks)};
  const FixedPartsMask fixed_parts = sequence ? FixedPartsMask::kNone : FixedPartsOf(file);
  MaskedSequence opened(sequence ? std::move(sequence)
                                 : KeepFrames(clip ? OpenSequence(std::get<fs::path>(*clip))
                                                   : OpenSource(file, kTracks)),
                        std::move(masks),
                        clip || file.meta.frames.empty(),
                        fixed_parts);
  if (!clip) doubts.push_back(DoubtOfClip(file, kTracks, opened));
  if (!mask_array && as_before) doubts.push_back(DoubtOfMask(file, kTracks));
  SecondPass second = MeasureAgain(file, model, opened, arguments.second_pass, progress);
  doubts.push_back(DoubtOfMeasuring(second.figures));
  std::erase(doubts, "");
  if (!mask_array) NoteMask(mask_name, second.file);
  return {std::move(second.file), std::move(doubts)};
}

// A model with its summary by Reconstruct; for a model that was read, that of summary.json or none.
struct Model {
  Reconstruction reconstruction;
  std::string summary = "{}";
  std::vector<std::string> warnings;
};

Model ReconstructTracks(const TrackFile& file,
                        const std::optional<fs::path>& folder,
                        const std::string& options,
                        const py::object& callback) {
  const auto arguments = FromJsonText<ReconstructOptions>(options, "reconstruct()");
  const StageProgress progress = ProgressTo(callback);
  const CallWithoutGil no_gil;
  const InterruptionCheck interruption(RaiseOfSignals);
  ReconstructResult result = folder ? ReconstructIntoFolder(file, arguments, *folder, progress)
                                    : Reconstruct(file, arguments, {}, progress);
  std::string summary = SummaryToJson(result, file.frames, arguments).dump();
  return {std::move(result.reconstruction), std::move(summary), std::move(result.warnings)};
}

Model ReadModel(const fs::path& folder) {
  Model model{ReadModelFolder(folder), "{}", {}};
  std::error_code error;
  const fs::path summary = folder / "summary.json";
  if (fs::exists(summary, error)) model.summary = ReadBytes(summary);
  return model;
}

template <typename Map>
std::vector<std::uint32_t> KeysOf(const Map& map) {
  std::vector<std::uint32_t> keys;
  for (const auto& [key, value] : map) keys.push_back(ToInt(key));
  return keys;
}

template <typename T>
py::array_t<T> AsArray(const std::vector<T>& values) {
  return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

constexpr std::uint32_t kMostFrames = 10'000'000;

// The frames with these numbers, ascending. Throws Error if an observation is in another frame.
std::vector<FrameInfo> FramesNumbered(const py::array_t<std::uint32_t>& numbers,
                                      const TrackSet& tracks) {
  std::vector<FrameInfo> frames;
  for (py::ssize_t i = 0; i < numbers.size(); ++i) {
    const std::uint32_t number = numbers.at(i);
    if (number >= kMostFrames) {
      ThrowUsageError("frame {}: up to {} are supported, counted from 0", number, kMostFrames);
    }
    if (!frames.empty() && number <= ToInt(frames.back().index)) {
      ThrowUsageError("frame {} comes after frame {}: give the frames in order, each once",
                      number,
                      ToInt(frames.back().index));
    }
    frames.push_back({FrameIndex{number}, NumberedFrameName(FrameIndex{number}), 0});
  }
  for (const FrameIndex frame : tracks.frames()) {
    if (!std::ranges::binary_search(frames, frame, {}, &FrameInfo::index)) {
      ThrowError("there is an observation in frame {}, which is not one of the {} frames",
                 ToInt(frame),
                 frames.size());
    }
  }
  return frames;
}

// The tracks, with frames named like those of a video, and the doubts about them.
std::pair<TrackFile, std::string> MakeTracks(const py::array_t<ObservationRow>& rows,
                                             const py::array_t<std::uint32_t>& frames,
                                             int width_px,
                                             int height_px,
                                             const std::optional<Camera>& camera) {
  if (width_px < 1 || height_px < 1 || width_px > kMaxPictureSidePx ||
      height_px > kMaxPictureSidePx) {
    ThrowUsageError("{} x {} px is not a picture size: give width_px and height_px of the clip",
                    width_px,
                    height_px);
  }
  TrackFile file;
  file.width_px = width_px;
  file.height_px = height_px;
  if (camera) CheckCameraSize(*camera, width_px, height_px);
  file.camera = camera;
  file.meta = {.program = fmt::format("cohort {}", kVersion), .tracker = "import"};
  file.tracks = ToTracks(rows);
  file.frames = FramesNumbered(frames, file.tracks);
  std::string doubt = PredictOutside(file, "the tracks", "that size", file.tracks);
  return {std::move(file), std::move(doubt)};
}

// The doubt about a database whose images are not numbered in the order of their names, which
// happens if COLMAP extracted features on several threads; else empty.
std::string DoubtOfOrder(const ColmapDatabase& database, const fs::path& path) {
  std::vector<std::string> names;
  for (const auto& [id, image] : database.images) names.push_back(image.name);
  if (std::ranges::is_sorted(names, NaturalLess)) return "";
  return fmt::format(
      "{}: its images are not numbered in the order of their names, but the numbers are taken as "
      "frames: 'cohort import' with the clip puts them in order",
      path.string());
}

// The tracks of a database, whose images are the frames, and the doubts about them.
std::pair<TrackFile, std::string> ReadDatabaseTracks(const fs::path& path) {
  const ColmapDatabase database = ReadColmapDatabase(path);
  TrackFile file;
  for (const auto& [id, image] : database.images) {
    file.frames.push_back({FrameOfColmapImage(id), image.name, 0});
  }
  ImportedTracks imported = TracksOfColmapDatabase(database, file.frames, path);
  file.width_px = imported.camera->width_px;
  file.height_px = imported.camera->height_px;
  file.camera = imported.camera;
  file.meta = {.program = fmt::format("cohort {}", kVersion),
               .tracker = "import",
               .imported_from = AbsolutePath(path)};
  file.tracks = std::move(imported.tracks);
  return {std::move(file), DoubtOfOrder(database, path)};
}

std::vector<std::tuple<std::uint32_t, std::uint32_t, std::string>> EndsOf(const TrackFile& file) {
  std::vector<std::tuple<std::uint32_t, std::uint32_t, std::string>> ends;
  for (const TrackEnd& end : file.tracks.ends()) {
    ends.emplace_back(ToInt(end.feature),
                      ToInt(end.last_frame),
                      std::string(NameOf(kLossReasonNames, end.reason)));
  }
  return ends;
}

// Names of files need not be UTF-8; other bytes become surrogates, as in Python's own paths.
void SetError(const py::handle& type, const std::string& what) {
  const std::string line = OneLine(what);
  const auto text = py::reinterpret_steal<py::object>(
      PyUnicode_DecodeUTF8(line.data(), static_cast<Py_ssize_t>(line.size()), "surrogateescape"));
  PyErr_SetObject(type.ptr(), text.ptr());
}

void BindErrors(py::module_& module) {
  static const py::exception<Error> error(module, "Error", PyExc_RuntimeError);
  const py::tuple bases = py::make_tuple(error, py::handle(PyExc_ValueError));
  static const py::exception<UsageError> usage_error(module, "UsageError", bases);
  py::register_exception_translator(
      [](std::exception_ptr pointer) {  // NOLINT: by value, as pybind11 requires
        try {
          if (pointer) std::rethrow_exception(pointer);
        } catch (const UsageError& e) {
          SetError(usage_error, e.what());
        } catch (const Error& e) {
          SetError(error, e.what());
        } catch (const fs::filesystem_error& e) {
          SetError(error,
                   fmt::format("{}: {}",
                               e.path1().empty() ? "the empty path" : e.path1().string(),
                               e.code().message()));
        } catch (const cv::Exception& e) {
          SetError(error, fmt::format("OpenCV: {}", e.err));
        }
      });
}

void BindCamera(py::module_& module) {
  py::class_<Camera>(module, "Camera")
      .def(py::init([](int width_px,
                       int height_px,
                       const std::vector<double>& parameters,
                       const std::string& model,
                       bool known,
                       double guess_log_sigma) {
             if (parameters.size() < 4) {
               ThrowUsageError("a camera has at least fx, fy, cx, cy: {} numbers were given",
                               parameters.size());
             }
             std::vector<std::string> words;
             for (const double value : parameters) words.push_back(fmt::format("{}", value));
             if (model == "fisheye") {
               words.insert(words.begin() + 4, model);
             } else if (model != "pinhole") {
               ThrowUsageError("camera model '{}': give pinhole or fisheye", model);
             }
             Camera camera = CameraFromWords(words);
             camera.width_px = width_px;
             camera.height_px = height_px;
             camera.known = known;
             camera.guess_log_sigma = guess_log_sigma;
             if (const std::string fault = FaultOf(camera); !fault.empty()) {
               ThrowUsageError("the camera: {}", fault);
             }
             return camera;
           }),
           py::arg("width_px"),
           py::arg("height_px"),
           py::arg("parameters"),
           py::arg("model") = "pinhole",
           py::arg("known") = true,
           py::arg("guess_log_sigma") = Camera().guess_log_sigma)
      .def_readonly("width_px", &Camera::width_px)
      .def_readonly("height_px", &Camera::height_px)
      .def_readonly("fx", &Camera::fx)
      .def_readonly("fy", &Camera::fy)
      .def_readonly("cx", &Camera::cx)
      .def_readonly("cy", &Camera::cy)
      .def_readonly("known", &Camera::known)
      .def_readonly("guess_log_sigma",
                    &Camera::guess_log_sigma,
                    "For a guess: the standard deviation of the logarithm of its focal length.")
      .def_property_readonly(
          "model",
          [](const Camera& camera) { return std::string(NameOf(kCameraModelNames, camera.model)); })
      .def_property_readonly(
          "distortion",
          [](const Camera& c) {
            return c.model == CameraModel::kFisheye
                       ? std::vector<double>{c.k1, c.k2, c.k3, c.k4}
                       : std::vector<double>{c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5, c.k6};
          },
          "In OpenCV's order: k1,k2,p1,p2,k3,k4,k5,k6; for a fisheye lens k1,k2,k3,k4.")
      .def_property_readonly(
          "text",
          [](const Camera& camera) {
            return fmt::format("{}", fmt::join(WordsOfCamera(camera), ","));
          },
          "In the form that the program's --camera takes.")
      .def("project",
           &ProjectAll,
           py::arg("points_in_cam"),
           "(N, 3) in the camera's frame -> (N, 2) [px]; NaN at or behind the camera.")
      .def("unproject",
           &UnprojectAll,
           py::arg("xy"),
           "Pixels (N, 2) -> (N, 2), X/Z and Y/Z of their rays.")
      .def("__repr__", [](const Camera& camera) {
        return fmt::format("<cohort.Camera {} x {} px, {}{}>",
                           camera.width_px,
                           camera.height_px,
                           fmt::join(WordsOfCamera(camera), ","),
                           camera.known ? "" : ", guessed");
      });
}

void BindTrackFile(py::module_& module) {
  py::class_<TrackFile>(module, "TrackFile")
      .def_property_readonly("source", [](const TrackFile& file) { return ToStr(file.source); })
      .def_property_readonly("image_root",
                             [](const TrackFile& file) { return ToStr(file.image_root); })
      .def_readonly("width_px", &TrackFile::width_px)
      .def_readonly("height_px", &TrackFile::height_px)
      .def_readonly("camera", &TrackFile::camera)
      .def_property_readonly("meta",
                             [](const TrackFile& file) {
                               py::dict meta;
                               for (const auto& [name, text] : RowsOf(file.meta)) {
                                 meta[ToStr(name)] = ToStr(text);
                               }
                               return meta;
                             })
      .def_property_readonly("frames",
                             [](const TrackFile& file) {
                               std::vector<std::uint32_t> indices;
                               for (const FrameInfo& frame : file.frames) {
                                 indices.push_back(ToInt(frame.index));
                               }
                               return AsArray(indices);
                             })
      .def_property_readonly("frame_names",
                             [](const TrackFile& file) {
                               py::list names;
                               for (const FrameInfo& frame : file.frames) {
                                 names.append(ToStr(frame.name));
                               }
                               return names;
                             })
      .def_property_readonly("timestamps_ns",
                             [](const TrackFile& file) {
                               std::vector<std::int64_t> times;
                               for (const FrameInfo& frame : file.frames) {
                                 times.push_back(frame.timestamp_ns);
                               }
                               return AsArray(times);
                             })
      .def_property_readonly("track_ids",
                             [](const TrackFile& file) {
                               std::vector<std::uint32_t> ids;
                               for (const FeatureId id : file.tracks.features()) {
                                 ids.push_back(ToInt(id));
                               }
                               return AsArray(ids);
                             })
      .def_property_readonly("ends", &EndsOf)
      .def("observations", [](const TrackFile& file) { return ToArray(file.tracks); });

  module.attr("OBSERVATION") = py::dtype::of<ObservationRow>();
  using NoGil = py::call_guard<CallWithoutGil>;
  module.def("make_tracks",
             &MakeTracks,
             py::arg("rows"),
             py::arg("frames"),
             py::arg("width_px"),
             py::arg("height_px"),
             py::arg("camera"));
  module.def("read_tracks", &ReadTrackFile, py::arg("path"), NoGil());
  module.def("write_tracks", &WriteTrackFile, py::arg("path"), py::arg("tracks"), NoGil());
  module.def(
      "read_csv",
      [](const fs::path& path, int width_px, int height_px) {
        std::vector<std::string> doubts;
        const TrackSet tracks = [&] {
          const CallWithoutGil no_gil;
          TracksCsv csv = ReadTracksCsv(path);
          doubts.push_back(DoubtOfIds(csv, path.string()));
          TrackFile of_pictures;
          of_pictures.width_px = width_px;
          of_pictures.height_px = height_px;
          doubts.push_back(PredictOutside(of_pictures, path.string(), "that size", csv.tracks));
          std::erase(doubts, "");
          return std::move(csv.tracks);
        }();
        return std::pair(ToArray(tracks), doubts);
      },
      py::arg("path"),
      py::arg("width_px"),
      py::arg("height_px"));
  module.def("describe_focal_guess", &DescribeFocalGuess, py::arg("tracks"));
  module.def(
      "doubt_of_camera",
      [](const TrackFile& file) { return DoubtOfCamera(file.camera); },
      py::arg("tracks"));
  module.def(
      "write_csv",
      [](const fs::path& path, const TrackFile& tracks) { WriteTracksCsv(path, tracks.tracks); },
      py::arg("path"),
      py::arg("tracks"),
      NoGil());
  module.def("read_colmap_database", &ReadDatabaseTracks, py::arg("path"), NoGil());
  module.def(
      "write_colmap_database",
      [](const fs::path& path, const TrackFile& tracks, const std::string& options) {
        WriteColmapDatabase(
            path, tracks, FromJsonText<ColmapDatabaseOptions>(options, "write_colmap_database()"));
      },
      py::arg("path"),
      py::arg("tracks"),
      py::arg("options"),
      NoGil());
}

void BindModel(py::module_& module) {
  const auto keys = [](auto Reconstruction::*map) {
    return [map](const Model& model) { return AsArray(KeysOf(model.reconstruction.*map)); };
  };
  py::class_<Model>(module, "Model")
      .def_property_readonly("camera",
                             [](const Model& model) { return model.reconstruction.camera; })
      .def_property_readonly("readout",
                             [](const Model& model) { return model.reconstruction.readout; })
      .def_property_readonly("frames", keys(&Reconstruction::cam_from_world))
      .def_property_readonly(
          "frame_names",
          [](const Model& model) {
            py::list names;
            for (const auto& [frame, pose] : model.reconstruction.cam_from_world) {
              const auto& known = model.reconstruction.frame_names;
              const auto name = known.find(frame);
              names.append(ToStr(name == known.end() ? "" : name->second));
            }
            return names;
          })
      .def_property_readonly("track_ids", keys(&Reconstruction::points))
      .def_property_readonly("errors_px",
                             [](const Model& model) {
                               std::vector<double> errors;
                               for (const auto& [id, point] : model.reconstruction.points) {
                                 errors.push_back(point.mean_reprojection_px);
                               }
                               return AsArray(errors);
                             })
      .def_readonly("summary", &Model::summary)
      .def_readonly("warnings", &Model::warnings)
      .def("poses", [](const Model& model) { return PosesOf(model.reconstruction); })
      .def("intrinsics", [](const Model& model) { return IntrinsicsOf(model.reconstruction); })
      .def("points", [](const Model& model) { return PointsOf(model.reconstruction); })
      .def("views", [](const Model& model) { return ViewsOf(model.reconstruction); });

  module.def("read_model", &ReadModel, py::arg("folder"), py::call_guard<CallWithoutGil>());
  module.def(
      "write_model",
      [](const fs::path& folder, const Model& model) {
        WriteModelFolder(model.reconstruction, model.summary, folder);
      },
      py::arg("folder"),
      py::arg("model"),
      py::call_guard<CallWithoutGil>());
}

void BindWork(py::module_& module) {
  module.def("default_options", &DefaultOptions, py::arg("function"));
  module.def("track",
             &Track,
             py::arg("clip"),
             py::arg("options"),
             py::arg("rgb"),
             py::arg("mask"),
             py::arg("camera"),
             py::arg("progress"));
  module.def("reconstruct",
             &ReconstructTracks,
             py::arg("tracks"),
             py::arg("folder"),
             py::arg("options"),
             py::arg("progress"));
  module.def(
      "refine",
      [](const TrackFile& tracks,
         const Model& model,
         const std::optional<ClipArgument>& clip,
         const std::string& options,
         bool rgb,
         const std::optional<py::object>& mask,
         const fs::path& mask_path,
         const py::object& progress) {
        return Refine(tracks, model.reconstruction, clip, options, rgb, mask, mask_path, progress);
      },
      py::arg("tracks"),
      py::arg("model"),
      py::arg("clip"),
      py::arg("options"),
      py::arg("rgb"),
      py::arg("mask"),
      py::arg("mask_path"),
      py::arg("progress"));
}

PYBIND11_MODULE(_cohort, module) {
  module.doc() = "The implementation of the package cohort; its names are not a public interface.";
  module.attr("__version__") = kVersion;
  RegisterRows();
  BindErrors(module);
  BindCamera(module);
  BindTrackFile(module);
  BindModel(module);
  BindWork(module);
  py::module_::import("atexit").attr("register")(py::cpp_function(&CallWithoutGil::AwaitCalls));
}

}  // namespace
}  // namespace cohort
