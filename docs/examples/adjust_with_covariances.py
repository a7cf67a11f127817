#!/usr/bin/env python3
"""Adjusts a COLMAP model with the covariance of every keypoint, by pycolmap and pyceres.

    cohort export clip.tracks --colmap-database clip.db --covariances clip.npz
    mkdir models adjusted
    colmap mapper --database_path clip.db --image_path images --output_path models
    python3 adjust_with_covariances.py models/0 clip.npz adjusted

Run by hand with pycolmap 4.2 (August 2026: ReprojErrorCost takes point, pose of 7 numbers, camera) and pyceres 2.7
(April 2026, with ProductManifold). Older ones split the pose into rotation and translation. Tested with every change:
`covariances` and `covariance_of`.
"""
import sys

import numpy as np

FLOOR_PX = 0.1  # what no covariance knows: how far a track is off its point as a whole


def covariances(path):
    """{(image name, index in points2D): (x and y as COLMAP has them, covariance [px^2])}"""
    z = np.load(path)
    names = dict(zip(z['image_ids'], np.char.decode(z['image_names'], 'utf-8')))
    rows = zip(z['image_id'], z['keypoint'], z['xy'], z['covariance'])
    return {(str(names[image]), int(k)): (xy, c) for image, k, xy, c in rows if np.isfinite(c).all()}


def covariance_of(measured, name, k, xy):
    """What to adjust with: of 1 px where none was measured. Stops at a model of other keypoints."""
    there, covariance = measured.get((name, k), (xy, np.eye(2)))
    if not np.allclose(there, xy, rtol=0.0, atol=1e-3):
        sys.exit(f'keypoint {k} of {name} is at {xy} in the model, at {there} in the covariances')
    return covariance + FLOOR_PX ** 2 * np.eye(2)


def adjust(model, measured):
    import pyceres
    import pycolmap
    import pycolmap.cost_functions
    problem, loss = pyceres.Problem(), pyceres.HuberLoss(3.0)  # three standard deviations
    for image in model.images.values():
        camera, pose = model.cameras[image.camera_id], model.frames[image.frame_id].rig_from_world.params
        for k, point2D in enumerate(image.points2D):
            if point2D.has_point3D():
                covariance = covariance_of(measured, image.name, k, point2D.xy)
                cost = pycolmap.cost_functions.ReprojErrorCost(camera.model, covariance, point2D.xy)
                problem.add_residual_block(cost, loss, [model.points3D[point2D.point3D_id].xyz, pose, camera.params])
        if problem.has_parameter_block(pose):
            problem.set_manifold(pose, pyceres.ProductManifold(pyceres.EigenQuaternionManifold(),
                                                               pyceres.EuclideanManifold(3)))
    for camera in model.cameras.values():
        if problem.has_parameter_block(camera.params):
            problem.set_parameter_block_constant(camera.params)  # known; leave out to refine it
    options, summary = pyceres.SolverOptions(), pyceres.SolverSummary()
    options.function_tolerance, options.max_num_iterations = 1e-9, 100
    options.linear_solver_type = pyceres.LinearSolverType.SPARSE_SCHUR
    pyceres.solve(options, problem, summary)
    print(summary.BriefReport())


if __name__ == '__main__':
    import pycolmap
    reconstruction = pycolmap.Reconstruction(sys.argv[1])
    adjust(reconstruction, covariances(sys.argv[2]))
    reconstruction.write(sys.argv[3])
