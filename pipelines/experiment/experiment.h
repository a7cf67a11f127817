#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/colmap/sift_mapper.h"
#include "backend/mapper/mapper.h"
#include "datasets/open_sequence.h"
#include "frontend/track/tracker_options.h"
#include "pipelines/experiment/paper_protocol.h"
#include "pipelines/experiment/results.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

struct ExperimentPlan;

// The measurement of every cell.
enum class Protocol {
  kReconstruction,  // tracks, and the models made from them
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
  bool collect = false;
  bool halves = true;
  Layout layout = Layout::kAuto;
  std::string frames;
  std::string camera;
  std::string camera_prior;
  std::string mask;
  TrackerOptions tracking;
  MapperOptions ceres;
  ColmapOptions colmap;
  SecondPassOptions second_pass;
  SiftOptions sift;
  PaperProtocolOptions paper;

  // Long, because it lists one statement per option.
  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.List("inputs", o.inputs, "The clips, given as for `cohort track`.", Tier::kCommon);
    v.Text("out",
           o.out,
           "The folder for results.csv, results.json, report.html and cells/.",
           Tier::kCommon);
    v.Choice("protocol",
             o.protocol,
             kProtocolNames,
             "What is measured. reconstruction: the models made from the tracks. paper: how far "
             "trackers stray from points of known trajectory, on clips with exact truth, with the "
             "trackers' own checks that end features switched off.",
             Tier::kCommon);
    v.List(
        "trackers",
        o.trackers,
        "The trackers to compare: those of `cohort track`; kltN, anchored-kltN: with a window of N "
        "px; subspace-paper, descent-paper: the joint and the first-order tracker as published in "
        "the paper, without measurement; NAME-refined, NAME-online: with and without a second pass "
        "(subspace has one by default); ceiling: the truth with the least noise that a patch of 21 "
        "px allows; sift: COLMAP's own features (backend colmap only); F.json: the tracker options "
        "in this file.",
        Tier::kCommon);
    v.List("backends",
           o.backends,
           "The backends, in protocol reconstruction: ceres; colmap; triangulation: only points, "
           "from the true cameras.",
           Tier::kCommon);
    v.List("levels",
           o.levels,
           "How dark `cohort degrade` makes the clips. clean, medium, hard or a number: that "
           "level; sensor, phone: the recipe of that name at level hard; sensor-half, -4th, -8th, "
           "-16th: recipe sensor at level hard with that share of the light; phone-medium: recipe "
           "phone at level medium; as-is: unchanged.",
           Tier::kCommon);
    v.List("seeds",
           o.seeds,
           "The seeds of the noise and of COLMAP. Tables show medians over the seeds: more seeds "
           "give more reliable figures; the time grows in proportion.",
           Tier::kCommon);
    v.Number("jobs",
             o.jobs,
             1,
             1024,
             "The number of processes that run at a time; the results stay the same.",
             Tier::kCommon);
    v.Text("shard",
           o.shard,
           "Run only every n-th clip x level x seed x tracker, given as i/n with i from 0, so that "
           "several machines can share the work.",
           Tier::kCommon);
    v.Flag("resume",
           o.resume,
           "Keep the finished cells of an earlier run. Cells that depend on an option, a file of "
           "the clip or a version of cohort that has changed since are run again; a change of "
           "COLMAP is not noticed.",
           Tier::kCommon);
    v.Flag("collect",
           o.collect,
           "Run nothing; only write the results of the finished cells, such as those of shards.",
           Tier::kCommon);
    v.Flag("halves",
           o.halves,
           "For clips without true cameras, compare the models of two halves of the features; "
           "--no-halves skips this, which saves two reconstructions per cell.");
    v.Choice("layout",
             o.layout,
             kLayoutNames,
             "How to read the inputs; only needed if their layout is not recognised.",
             Tier::kCommon);
    v.Text("frames",
           o.frames,
           "Read only frames A to B - 1 of the inputs, given as A:B, or every STEP-th of them, "
           "A:B:STEP.",
           Tier::kCommon);
    v.Text("camera",
           o.camera,
           "The camera of all inputs: fx,fy,cx,cy in pixels and its distortion, as for `cohort "
           "track`.",
           Tier::kCommon);
    v.Text("camera_prior",
           o.camera_prior,
           "A prior of the focal length of all inputs, FOCAL_PX or FOCAL_PX+-SIGMA in pixels, as "
           "for `cohort track`.",
           Tier::kCommon);
    v.Text("mask",
           o.mask,
           "A mask of the frames' size, black where no tracker may have a feature, such as on the "
           "bonnet of a car, or everywhere but on an object that is turned.",
           Tier::kCommon);
    v.Group("tracking", o.tracking, "all trackers", Tier::kExpert);
    v.Group("ceres", o.ceres, "backend ceres", Tier::kExpert);
    v.Group("colmap", o.colmap, "backend colmap", Tier::kExpert);
    v.Group("second_pass", o.second_pass, "second pass, for trackers that have one", Tier::kExpert);
    v.Group("sift", o.sift, "tracker sift", Tier::kExpert);
    v.Group("paper", o.paper, "protocol paper", Tier::kExpert);
  }
};

// Degrades, tracks, reconstructs and evaluates every cell, each in its own process, below
// OUT/cells. A failing cell is a failure in the results and does not stop the others. With
// `collect` it runs none. Returns the plan, from which CollectResults makes the results.
ExperimentPlan RunCells(const ExperimentOptions& options);

}  // namespace cohort
