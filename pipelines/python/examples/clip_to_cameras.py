# %% [markdown]
# # From dark video to cameras, in Python
# Cells of a notebook (VS Code, Spyder, jupytext), or a script: `python3 clip_to_cameras.py clip.mp4`.

# %%
import pathlib
import sys

import numpy as np

import cohort

clip = sys.argv[1] if len(sys.argv) > 1 else "clip.mp4"
out = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ".")

# %% [markdown]
# ## Track
# Options have the names of `cohort track --dump-config`. After the last frame all features are
# measured again where a reconstruction says that they are.

# %%
tracks = cohort.track(clip, detector={"max_features": 500})
print(tracks)
tracks.write(out / "clip.tracks")

# %% [markdown]
# ## Look at the tracks
# A row a position, for pandas and the like; or arrays over frames and tracks.

# %%
rows = tracks.observations
print(f"{np.mean(rows['observed']):.0%} of {len(rows)} positions are confirmed by the image")
sigma_px = np.sqrt((rows["cov_xx"] + rows["cov_yy"]) / 2)
print(f"their standard deviation is {np.nanmedian(sigma_px):.2f} px, in the median")

dense = tracks.dense()
lengths = dense.observed.sum(axis=0)
print(f"a track is seen in {lengths.mean():.1f} of {len(dense.frames)} frames, on average")
path = dense.xy[:, lengths.argmax()]  # the longest one, (T, 2)
print(f"the longest one begins at {path[np.isfinite(path[:, 0])][0].round(1)}")

# %% [markdown]
# ## Reconstruct
# A clip that gives no model is no exception: `quality` and `reasons` say what to think of it.

# %%
model = cohort.reconstruct(tracks, out / "model")
print(model, *model.reasons, sep="\n")
if not model.failed:
    steps = np.linalg.norm(np.diff(model.centers, axis=0), axis=1)
    print(f"the camera moves by {steps.mean():.3f} units a frame")
    print(f"focal length {model.camera.fx:.0f} px")

# %% [markdown]
# ## Frames of your own
# Anything that gives arrays: a list, a generator, a camera. Here a texture that slides.


# %%
def frames(count: int = 10):
    texture = np.random.default_rng(1).integers(0, 255, (24, 48)).astype(np.uint8)
    texture = np.kron(texture, np.ones((8, 8), np.uint8))
    for i in range(count):
        yield texture[:, i : i + 256]


slid = cohort.track(frames(), tracker="klt").dense()
motion = np.nanmedian(np.diff(slid.xy, axis=0), axis=(0, 1))
print(f"they move by {motion.round(2)} px a frame")

# %% [markdown]
# ## Tracks of any other tracker
# Arrays go in as they come out; then COLMAP's database is a call away.

# %%
again = cohort.Tracks.from_dense(
    dense.xy,
    dense.observed,
    dense.covariances,
    width_px=tracks.width_px,
    height_px=tracks.height_px,
    camera=tracks.camera,
)
again.write_colmap_database(out / "clip.db")
print(f"{out / 'clip.db'} is for COLMAP")
