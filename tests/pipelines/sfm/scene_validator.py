#!/usr/bin/python3
"""Does a folder open as a scene? Reads it as the loaders of radiance fields do, and says what is wrong with it.

  scene_validator.py SCENE        exit 0 and a line of figures, or exit 1 and a line for each fault

- sparse/0 as Inria's 3D Gaussian Splatting and gsplat read it: cameras, images and points3D .bin, one PINHOLE camera or
  one for every image, principal points in the middle (Inria's takes no other), images by name in images/, of the
  camera's size, names in the order of ids; true colours of points; the .txt files say the same.
- transforms.json as Nerfstudio reads it: the same pictures, cameras (OpenGL's axes) and intrinsics, of all frames or of
  each; the points of its PLY file are those of sparse/0.
- What both say is a scene: rotations are rotations, points lie before the cameras that see them, near their pixel.
"""
import json
import pathlib
import struct
import sys

import numpy as np


class Reader:
    """A COLMAP .bin file."""

    def __init__(self, path):
        self.data, self.at = path.read_bytes(), 0

    def take(self, form):
        values = struct.unpack_from('<' + form, self.data, self.at)
        self.at += struct.calcsize('<' + form)
        return values

    def text(self):
        end = self.data.index(b'\0', self.at)
        text, self.at = self.data[self.at:end].decode(), end + 1
        return text

    def is_read(self):
        return self.at == len(self.data)


def rotation(w, x, y, z):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def read_binary(folder):
    cameras, images, points = {}, {}, {}
    r = Reader(folder / 'cameras.bin')
    for _ in range(*r.take('Q')):
        camera, model, width, height = r.take('IiQQ')
        if model != 1:
            raise ValueError(f'camera {camera} has model {model}, not PINHOLE')
        cameras[camera] = (width, height, *r.take('4d'))
    whole = r.is_read()
    r = Reader(folder / 'images.bin')
    for _ in range(*r.take('Q')):
        image, *pose = r.take('I7d')
        camera, = r.take('I')
        name = r.text()
        count, = r.take('Q')
        rows = np.array(r.take('ddq' * count)).reshape(-1, 3)
        images[image] = (name, camera, rotation(*pose[:4]), np.array(pose[4:]), rows[:, :2], rows[:, 2].astype(int))
    whole = whole and r.is_read()
    r = Reader(folder / 'points3D.bin')
    for _ in range(*r.take('Q')):
        point, *xyz = r.take('Q3d')
        rgb = r.take('3B')
        error, count = r.take('dQ')
        points[point] = (np.array(xyz), rgb, error, np.array(r.take('II' * count)).reshape(-1, 2))
    if not (whole and r.is_read()):
        raise ValueError('bytes are left over behind the last entry')
    return cameras, images, points


def jpeg_size(path):
    data = path.read_bytes()
    at = 2
    while at + 9 < len(data):
        marker, length = data[at + 1], int.from_bytes(data[at + 2:at + 4], 'big')
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(data[at + 7:at + 9], 'big'), int.from_bytes(data[at + 5:at + 7], 'big')
        at += 2 + length
    raise ValueError(f'{path} is no JPEG')


def check_sparse(scene, faults):
    cameras, images, points = read_binary(scene / 'sparse/0')
    if len(cameras) not in (1, len(images)) or len(images) < 2 or len(points) < 10:
        faults.append(f'{len(cameras)} cameras, {len(images)} images, {len(points)} points are no scene')
        return cameras, images, points
    for width, height, _, _, cx, cy in cameras.values():
        if abs(cx - width / 2) > 1e-6 or abs(cy - height / 2) > 1e-6:
            faults.append(f'the principal point {cx}, {cy} is not the middle of {width}x{height}')
    if [images[i][0] for i in sorted(images)] != sorted(image[0] for image in images.values()):
        faults.append('names are not in the order of ids')
    if {p.name for p in (scene / 'images').iterdir()} != {image[0] for image in images.values()}:
        faults.append('images/ has other files than images.bin names')
    errors = []
    for number, (name, camera, R, t, xy, ids) in images.items():
        if camera not in cameras:
            faults.append(f'{name} has camera {camera}, which is not there')
            continue
        width, height, fx, fy, cx, cy = cameras[camera]
        path = scene / 'images' / name
        if not path.exists():
            faults.append(f'images/{name} is missing')
        elif jpeg_size(path) != (width, height):
            faults.append(f'images/{name} has another size than the camera')
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-9) or abs(np.linalg.det(R) - 1) > 1e-9:
            faults.append(f'{name} has no rotation')
        seen = [(p, pixel) for p, pixel in zip(ids, xy) if p != -1]
        if any(p not in points for p, _ in seen):
            faults.append(f'{name} sees a point that is not there')
            continue
        if not seen:
            continue
        in_cam = np.array([points[p][0] for p, _ in seen]) @ R.T + t
        if (in_cam[:, 2] <= 0).any():
            faults.append(f'{name} sees points behind it')
        pixels = in_cam[:, :2] / in_cam[:, 2:] * [fx, fy] + [cx, cy]
        errors.extend(np.linalg.norm(pixels - np.array([pixel for _, pixel in seen]), axis=1))
    if not errors or np.median(errors) > 2.0:
        faults.append('points are not where the pictures have them')
    for number, (_, _, _, track) in points.items():
        if len(track) < 1 or any(images[i][5][k] != number for i, k in track if i in images) or \
                any(i not in images for i, _ in track):
            faults.append(f'the track of point {number} does not agree with the images')
            break
    if len({rgb for _, rgb, _, _ in points.values()}) < 3:
        faults.append('all points have the same colour')
    text = (scene / 'sparse/0/images.txt').read_text().splitlines()
    rows = [line.split() for line in text if line and not line.startswith('#')][::2]
    if {row[9] for row in rows} != {image[0] for image in images.values()}:
        faults.append('images.txt names other images than images.bin')
    return cameras, images, points


def read_ply(path):
    data = path.read_bytes()
    head, _, body = data.partition(b'end_header\n')
    count = int(head.split(b'element vertex ')[1].split()[0])
    rows = np.frombuffer(body, dtype=[('xyz', '<f4', 3), ('rgb', 'u1', 3)])
    if len(rows) != count:
        raise ValueError(f'{path} promises {count} points and has {len(rows)}')
    return rows


def check_transforms(scene, cameras, images, points, faults):
    meta = json.loads((scene / 'transforms.json').read_text())
    if meta['camera_model'] != 'PINHOLE' or any(meta[key] != 0 for key in ('k1', 'k2', 'p1', 'p2')):
        faults.append('transforms.json has another camera model than sparse/0')
    of_image = {image[0]: cameras[image[1]] for image in images.values()}
    for frame in meta['frames']:
        # What stands beside the frames is of all of them.
        told = [{**frame, **meta}[key] for key in ('w', 'h', 'fl_x', 'fl_y', 'cx', 'cy')]
        if not np.allclose(told, of_image.get(pathlib.Path(frame['file_path']).name, told), atol=1e-9):
            faults.append(f"{frame['file_path']} has another camera in transforms.json than in sparse/0")
            break
    frames = {pathlib.Path(frame['file_path']).name: np.array(frame['transform_matrix']) for frame in meta['frames']}
    if any(not (scene / frame['file_path']).exists() for frame in meta['frames']):
        faults.append('transforms.json names pictures that are not there')
    if set(frames) != {image[0] for image in images.values()}:
        faults.append('transforms.json has other pictures than sparse/0')
        return
    for name, _, R, t, _, _ in images.values():
        world_from_cam = np.eye(4)
        world_from_cam[:3, :3], world_from_cam[:3, 3] = R.T, -R.T @ t
        if not np.allclose(frames[name], world_from_cam @ np.diag([1, -1, -1, 1]), atol=1e-6):
            faults.append(f'{name} is elsewhere in transforms.json')
            break
    rows = read_ply(scene / meta['ply_file_path'])
    expected = np.array([points[p][0] for p in sorted(points)])
    if len(rows) != len(points) or not np.allclose(rows['xyz'], expected, rtol=1e-5, atol=1e-5):
        faults.append('the PLY file has other points than sparse/0')
    up = np.mean([matrix[:3, 1] for matrix in frames.values()], axis=0)
    if up[2] < 0.1:
        faults.append('the scene does not stand upright')


def main():
    scene = pathlib.Path(sys.argv[1])
    faults = []
    try:
        cameras, images, points = check_sparse(scene, faults)
        if not faults:
            check_transforms(scene, cameras, images, points, faults)
    except (OSError, ValueError, KeyError, IndexError, struct.error) as error:
        faults.append(f'{type(error).__name__}: {error}')
    for fault in faults:
        print(f'{scene}: {fault}')
    if not faults:
        print(f'{scene}: {len(images)} pictures, {len(points)} points')
    sys.exit(bool(faults))


if __name__ == '__main__':
    main()
