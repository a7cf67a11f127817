#pragma once

#include "frontend/tracks/track_npz.h"
#include "pipelines/console/command.h"
#include "pipelines/sfm/input.h"

namespace cohort {

enum class TracksForm { kAuto, kCsv, kNpz, kOpensfm, kColmap };
inline constexpr ChoiceNames<TracksForm, 5> kTracksFormNames{{{"auto", TracksForm::kAuto},
                                                              {"csv", TracksForm::kCsv},
                                                              {"npz", TracksForm::kNpz},
                                                              {"opensfm", TracksForm::kOpensfm},
                                                              {"colmap", TracksForm::kColmap}}};

struct ImportCommandOptions {
  std::string tracks;
  InputOptions input;
  std::string out;
  TracksForm from = TracksForm::kAuto;
  NpzTracksOptions npz;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks",
           o.tracks,
           "The tracks: a CSV file with columns track_id,frame,x,y[,observed][,residual], a NumPy "
           ".npz or .npy as point trackers save it, OpenSfM's tracks.csv, a COLMAP database with "
           "verified matches, or the folder of a COLMAP model.",
           Tier::kCommon);
    v.Choice("from",
             o.from,
             kTracksFormNames,
             "The format of the tracks; auto: recognised from the file.",
             Tier::kCommon);
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "The .tracks file to write.", Tier::kCommon);
    v.Group("npz", o.npz, "NumPy .npz");
  }
};

// Imports tracks of any other tracker into .tracks.
void RunImport(const ImportCommandOptions& options);

Command ImportCommand();

}  // namespace cohort
