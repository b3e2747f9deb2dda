"""The main job: a motion planned, exported, checked and delivered; what to change where there is none; FMUs written."""
