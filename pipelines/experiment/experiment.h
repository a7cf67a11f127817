#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/colmap/sift_mapper.h"
#include "backend/scene/mapper.h"
#include "datasets/readers/sequence.h"
#include "frontend/track/tracker_options.h"
#include "pipelines/experiment/paper_protocol.h"
#include "pipelines/experiment/results.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// What is measured of every cell.
enum class Protocol {
  kReconstruction,  // tracks, and the models made of them
  kPaper,           // the tracking errors of the paper's section 4; paper_protocol.h
};
inline constexpr ChoiceNames<Protocol, 2> kProtocolNames{
    {{"reconstruction", Protocol::kReconstruction}, {"paper", Protocol::kPaper}}};

// A grid: every input x level x seed x tracker x backend is a cell.
struct ExperimentOptions {
  std::vector<std::string> inputs;
  std::string out;
  Protocol protocol = Protocol::kReconstruction;
  std::vector<std::string> trackers{"klt", "subspace"};
  std::vector<std::string> backends{"ceres", "colmap"};
  std::vector<std::string> levels{"as-is"};
  std::vector<std::string> seeds{"1"};
  int jobs = 1;
  std::string shard;
  bool resume = false;
  Layout layout = Layout::kAuto;
  std::string frames;
  std::string camera;
  TrackerOptions tracking;
  MapperOptions ceres;
  ColmapOptions colmap;
  SecondPassOptions second_look;
  SiftOptions sift;
  PaperProtocolOptions paper;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.List("inputs", o.inputs, "clips, as `cohort track` takes them");
    v.Text("out", o.out, "folder for results.csv, results.json and cells/");
    v.Choice("protocol",
             o.protocol,
             kProtocolNames,
             "reconstruction: models made of the tracks; paper: how far trackers stray from points "
             "of known course, on clips with exact truth; the trackers' own checks by which "
             "features end are off");
    v.List(
        "trackers",
        o.trackers,
        "those of `cohort track`; kltN, anchored-kltN: with a window of N px; subspace-paper, "
        "descent-paper: joint and first-order tracker as the paper prints them, without "
        "measurement; subspace-fused: subspace with the most probable positions; NAME-refined, "
        "NAME-online: with and without a second pass (of subspace the default is with); ceiling: "
        "the "
        "truth with the least noise of a patch of 21 px; sift: COLMAP's own features (backend "
        "colmap); F.json: the tracker options of this file");
    v.List("backends",
           o.backends,
           "of protocol reconstruction: ceres; colmap; triangulation: points alone, from the true "
           "cameras");
    v.List("levels",
           o.levels,
           "as-is, or how dark `cohort degrade` makes the clips: clean, medium, hard, a number; "
           "sensor: its recipe sensor at hard");
    v.List("seeds", o.seeds, "of the noise and of COLMAP; tables show medians over them");
    v.Number("jobs", o.jobs, 1, 1024, "processes at a time");
    v.Text("shard", o.shard, "i/n, i from 0: only every n-th clip x level x seed x tracker");
    v.Flag("resume", o.resume, "keep finished cells of an earlier run with the same options");
    v.Choice("layout", o.layout, kLayoutNames, "how to read the inputs");
    v.Text("frames", o.frames, "A:B or A:B:STEP, frames A to B - 1 of the inputs; all without");
    v.Text("camera", o.camera, "fx,fy,cx,cy[,k1,k2,p1,p2] of all inputs [px]");
    v.Group("tracking", o.tracking, "all trackers");
    v.Group("ceres", o.ceres, "backend ceres");
    v.Group("colmap", o.colmap, "backend colmap");
    v.Group("second_look", o.second_look, "second pass of trackers that have one");
    v.Group("sift", o.sift, "tracker sift");
    v.Group("paper", o.paper, "protocol paper");
  }
};

// The tracker options that a name of ExperimentOptions::trackers stands for. Throws UsageError.
TrackerOptions NamedTracker(const std::string& name, const TrackerOptions& base);

// Degrades, tracks, reconstructs and evaluates every cell, each in a process of its own, below
// OUT/cells. A cell that fails, in whatever way, is a failure in the results and stops nothing.
// With a shard, the results are those of all cells that are finished by now.
ExperimentResults RunExperiment(const ExperimentOptions& options);

}  // namespace cohort
