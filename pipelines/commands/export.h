#pragma once

#include "backend/colmap/database.h"
#include "pipelines/console/command.h"

namespace cohort {

struct ExportCommandOptions {
  std::string tracks;
  std::string colmap_database;
  std::string csv;
  std::string opensfm;
  std::string bal;
  std::string model;
  bool write_frames = true;
  ColmapDatabaseOptions database;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "a .tracks file");
    v.Text("colmap_database", o.colmap_database, "COLMAP database to write (3.8 schema)");
    v.Text("csv", o.csv, "CSV file to write: track_id,frame,x,y,observed,residual");
    v.Text("opensfm", o.opensfm, "tracks.csv of OpenSfM to write");
    v.Text("bal", o.bal, "bundle adjustment problem of a model to write (BAL); needs --model");
    v.Text("model", o.model, "model folder that `cohort reconstruct` made of the tracks");
    v.Flag("write_frames",
           o.write_frames,
           "beside the database of a video, write its frames as pictures into F.db's F_images/");
    v.Group("database", o.database, "COLMAP database");
  }
};

// .tracks -> the files of other programs.
void RunExport(const ExportCommandOptions& options);

Command ExportCommand();

}  // namespace cohort
