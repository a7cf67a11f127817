#pragma once

#include "backend/colmap/tracks_to_database.h"
#include "pipelines/console/command.h"

namespace cohort {

struct ExportCommandOptions {
  std::string tracks;
  std::string colmap_database;
  std::string csv;
  std::string npz;
  std::string opensfm;
  std::string covariances;
  std::string bal;
  std::string model;
  bool global_shutter = false;
  bool write_frames = true;
  ColmapDatabaseOptions database;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "The .tracks file to export.", Tier::kCommon);
    v.Text("colmap_database",
           o.colmap_database,
           "Write a COLMAP database to this file (3.8 schema, which newer versions open "
           "too).",
           Tier::kCommon);
    v.Text("csv",
           o.csv,
           "Write a CSV table to this file: track_id,frame,x,y,observed,residual.",
           Tier::kCommon);
    v.Text("npz",
           o.npz,
           "Write NumPy arrays to this file: tracks (frames x tracks x 2), visibility and more.",
           Tier::kCommon);
    v.Text("opensfm", o.opensfm, "Write OpenSfM's tracks.csv to this file.", Tier::kCommon);
    v.Text("covariances",
           o.covariances,
           "Write the covariance of every keypoint of the COLMAP database to this file: a CSV "
           "table, or NumPy arrays if its name ends in .npz.",
           Tier::kCommon);
    v.Text("bal",
           o.bal,
           "Write the bundle adjustment problem of a model to this file, in BAL format; needs "
           "--model.",
           Tier::kCommon);
    v.Text("model",
           o.model,
           "The model folder that `cohort reconstruct` made from the tracks.",
           Tier::kCommon);
    v.Flag("global_shutter",
           o.global_shutter,
           "Write the positions as a global shutter would have seen them, for programs without a "
           "rolling-shutter model. They are computed from --model or, without it, from a "
           "reconstruction made for this purpose.",
           Tier::kCommon);
    v.Flag("write_frames",
           o.write_frames,
           "For a video, write the frames as pictures into F_images/ beside the database F.db, "
           "where COLMAP looks for them.",
           Tier::kCommon);
    v.Group("database", o.database, "COLMAP database");
  }
};

// Exports .tracks to the files of other programs.
void RunExport(const ExportCommandOptions& options);

Command ExportCommand();

}  // namespace cohort
