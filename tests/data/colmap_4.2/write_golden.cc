// What README.md beside it says: files as COLMAP's own code writes them. No part of the build.
//   write_golden database OLD.db NEW.db     opens (and so migrates) OLD.db, and writes NEW.db anew
//   write_golden model FOLDER BINARY TEXT   reads a model, and writes it in both forms
#include <iostream>
#include <string>

#include "colmap/scene/database.h"
#include "colmap/scene/reconstruction.h"
#include "colmap/util/version.h"

namespace {

using namespace colmap;

void CopyDatabase(Database& from, Database& to) {
  for (const Camera& camera : from.ReadAllCameras()) {
    to.WriteCamera(camera, true);
    Rig rig;
    rig.SetRigId(camera.camera_id);
    rig.AddRefSensor(camera.SensorId());
    to.WriteRig(rig, true);
  }
  for (const Image& image : from.ReadAllImages()) {
    to.WriteImage(image, true);
    Frame frame;
    frame.SetFrameId(image.ImageId());
    frame.SetRigId(image.CameraId());
    frame.AddDataId(image.DataId());
    to.WriteFrame(frame, true);
    to.WriteKeypoints(image.ImageId(), from.ReadKeypoints(image.ImageId()));
  }
  for (const auto& [pair, matches] : from.ReadAllMatches()) {
    const auto [image1, image2] = PairIdToImagePair(pair);
    to.WriteMatches(image1, image2, matches);
  }
  for (const auto& [pair, geometry] : from.ReadTwoViewGeometries()) {
    const auto [image1, image2] = PairIdToImagePair(pair);
    to.WriteTwoViewGeometry(image1, image2, geometry);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::cout << GetVersionInfo() << "\n";
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "database" && argc == 4) {
    const auto from = Database::Open(argv[2]);
    const auto to = Database::Open(argv[3]);
    CopyDatabase(*from, *to);
    std::cout << to->NumImages() << " images, " << to->NumFrames() << " frames, "
              << to->NumKeypoints() << " keypoints, " << to->NumInlierMatches() << " inliers\n";
    return 0;
  }
  if (what == "model" && argc == 5) {
    Reconstruction model;
    model.Read(argv[2]);
    model.WriteBinary(argv[3]);
    model.WriteText(argv[4]);
    std::cout << model.NumRegImages() << " images, " << model.NumPoints3D() << " points, "
              << model.ComputeMeanReprojectionError() << " px\n";
    return 0;
  }
  return 2;
}
