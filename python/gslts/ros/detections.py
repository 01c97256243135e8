"""Objects that came, moved or shifted as 3D detections; needs vision_msgs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from std_msgs.msg import Header
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesisWithPose

from gslts.ros.pose_message import pose_message
from gslts.ros.shown_change import ShownChange


def detection_array(header: Header, changes: Sequence[ShownChange]) -> Detection3DArray:
    """Return the objects of changes where they are now; those that are gone are left out.

    Args:
        header: Its frame is that of the boxes.
        changes: Published ones have score 1.
    """
    message = Detection3DArray(header=header)
    for change in changes:
        if change.present is None:
            continue
        detection = Detection3D(header=header, id=change.name)
        centre = np.eye(4)
        centre[:3, 3] = change.present.mean(axis=0)
        detection.bbox.center = pose_message(centre)
        size = detection.bbox.size
        size.x, size.y, size.z = (change.present[1] - change.present[0]).tolist()
        result = ObjectHypothesisWithPose()
        result.hypothesis.class_id = change.name
        result.hypothesis.score = 1.0 if change.confidence is None else change.confidence
        result.pose.pose = pose_message(centre)
        detection.results.append(result)
        message.detections.append(detection)
    return message
