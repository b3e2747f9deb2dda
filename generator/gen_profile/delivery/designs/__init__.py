"""The main job: a motion exported, checked and delivered; FMUs and planner blocks written."""
