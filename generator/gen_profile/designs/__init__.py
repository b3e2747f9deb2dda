"""The main job: a motion planned, exported, checked and delivered; FMUs written."""
