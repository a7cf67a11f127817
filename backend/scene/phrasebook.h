#pragma once

// The words about models: doubts, endings and frames aside. Other code decides that something is
// so, and gives the figures; each function here turns them into a sentence that says what is
// doubtful and what to do. The names of a doubt's figures are written to files (docs/files.md).

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

Doubt FewFramesDoubt(std::size_t registered, std::size_t frames);
// `is_largest`: false if larger parts are worthless.
Doubt PartsDoubt(std::size_t parts, bool is_largest);
Doubt OnlyTurnsDoubt(bool camera_known);
Doubt WeakDepthDoubt(double depth_uncertainty);
Doubt UnexplainedParallaxDoubt(double unexplained_parallax);
Doubt WorthlessDoubt(const MapperEnd& end);
Doubt CameraContradictedDoubt(const Camera& better, const Camera& given);
Doubt ExcessNoiseDoubt(double noise_left_px, double noise_px);
Doubt TwoCamerasDoubt(const Camera& camera, const Camera& rival);
// Of a model with a focal length per frame.
Doubt FoundZoomDoubt(double zoom);
// Of a model with one lens for all frames. `gain`: share of the cost that the changes remove.
Doubt UnmodelledZoomDoubt(double zoom, double gain);
Doubt CenterMovesDoubt(double shift_px, double gain, bool may_zoom);
Doubt FocalUncertainDoubt(double focal_sigma);
Doubt CamerasUncertainDoubt(double expected_error);
Doubt PointsOnALineDoubt(double spread_across_line);
// `frames`: those with few points, ascending, and `points` the fewest of them.
Doubt FewPointsDoubt(const std::vector<FrameIndex>& frames, std::size_t points, double median);
Doubt ThingsMoveDoubt(double moving_share);
Doubt NoModelByCeresDoubt(const std::string& termination);
Doubt NotJudgedDoubt();
// A doubt about a model by Ceres, as one about COLMAP's model of the same tracks.
Doubt AsDoubtByCeres(Doubt doubt);

// Why there is no model.
MapperEnd TooFewFramesEnd(std::size_t frames, std::size_t least);
MapperEnd TracksTooShortEnd(std::size_t tracks, int least_length);
MapperEnd NothingSharedEnd(int least_common);
MapperEnd NoGeometryEnd(int least_inliers);
MapperEnd StillPictureEnd(double motion_px, double noise_px);
MapperEnd OnlyTurnsEnd();
// Of tracks that drift while the camera stands still or turns.
MapperEnd StillWithDriftEnd();
MapperEnd OnlyTurnsWithDriftEnd();
MapperEnd NoStartEnd(std::size_t windows_tried);
MapperEnd WeakDepthEnd(double depth_uncertainty);
MapperEnd NotRigidEnd();

// "static camera: the picture moves by 0.3 px at most, ..."
std::string TerminationLine(const MapperEnd& end);
// The ending that such a line states; nullopt if it states none.
std::optional<MapperTermination> EndingOf(std::string_view line);

// "frames 0 to 47 show a still picture, such as a title card"
std::string DescribeAside(const Aside& aside);
// "frame 3", "frames 0 to 47"
std::string FramesText(FrameIndex first, FrameIndex last);

}  // namespace cohort
