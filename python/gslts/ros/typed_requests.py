"""Service and action of gslts_msgs, for nodes that want types instead of JSON; needs gslts_msgs."""

from __future__ import annotations

import json
import math
import queue
import threading
from typing import Any, Self

from geometry_msgs.msg import Point, Pose, Vector3
from gslts_msgs.action import GoTo
from gslts_msgs.msg import FoundObject
from gslts_msgs.srv import Query
from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from gslts.ros.answers import words_of
from gslts.ros.operation import Operation
from gslts.ros.requests import Request

THREADS = 4
"""Number of requests that wait for their answers at a time; others wait in the middleware."""
FEEDBACK_S = 1.0
"""Time between two messages of feedback of an errand, s."""
POLL_S, LAST_TURNS = 0.1, 5
"""Maximum time of a turn of the executor without work, s, and number of turns after the end."""
ENDING = "the node ends"
"""Reason for not answering."""
Answer = dict[str, Any]


class TypedRequests:
    """Answers requests in threads of their own; use it in a `with` statement.

    Args:
        operation: Follows the requests.
    """

    def __init__(self, operation: Operation) -> None:
        self._operation = operation
        self._waiting: list[tuple[str, str, queue.SimpleQueue[Answer]]] = []
        self._lock = threading.Lock()
        self._node = Node("gslts_requests", use_global_arguments=True)
        group = ReentrantCallbackGroup()
        self._node.create_service(Query, "gslts/query", self._on_query, callback_group=group)
        self._actions = ActionServer(
            self._node, GoTo, "gslts/go", self._on_errand, callback_group=group
        )
        self._executor = MultiThreadedExecutor(THREADS)
        self._executor.add_node(self._node)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="gslts-requests", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._ending.set()
            left = [waiter for _, _, waiter in self._waiting]
            self._waiting.clear()
        for waiter in left:
            waiter.put(_failure(ENDING))
        self._thread.join()
        self._executor.shutdown()
        self._actions.destroy()
        self._node.destroy_node()

    def on_answer(self, text: str) -> None:
        """Pass an answer to the request that waits for it, if there is one.

        Args:
            text: JSON, from `gslts.ros.answers`.
        """
        answer = json.loads(text)
        for kind in ("query", "go"):
            with self._lock:
                same = [each for each in self._waiting if each[:2] == (kind, answer.get(kind, ""))]
                if same:
                    self._waiting.remove(same[0])
            if same:
                same[0][2].put(answer)

    def _work(self) -> None:
        while not self._ending.is_set():
            self._executor.spin_once(timeout_sec=POLL_S)
        for _ in range(LAST_TURNS):  # Sends the answers to those who waited.
            self._executor.spin_once(timeout_sec=POLL_S)

    def _on_query(self, request: Query.Request, response: Query.Response) -> Query.Response:
        answer = self._submit("query", request.words).get()
        response.status, response.reason = answer["status"], answer.get("reason", "")
        response.frame_id, response.version = answer.get("frame_id", ""), answer.get("version", 0)
        response.objects = [_found_object(item) for item in answer.get("objects", ())]
        return response

    def _on_errand(self, goal: Any) -> GoTo.Result:
        waiter = self._submit("go", goal.request.words)
        while True:
            try:
                answer = waiter.get(timeout=FEEDBACK_S)
                break
            except queue.Empty:
                activity = self._operation.status().message
                goal.publish_feedback(GoTo.Feedback(activity=activity))
        if answer["status"] == "reached":
            goal.succeed()
        else:
            goal.abort()
        return errand_result(answer)

    def _submit(self, kind: str, text: str) -> queue.SimpleQueue[Answer]:
        """Submit words, and return where their answer comes."""
        waiter: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        try:
            words = words_of(text)
            with self._lock:
                if self._ending.is_set():
                    raise ValueError(ENDING)
                self._waiting.append((kind, words, waiter))
            try:
                if kind == "query":
                    self._operation.ask(words)
                else:
                    self._operation.requests.add(Request("go", words))
            except ValueError:
                with self._lock:
                    self._waiting.remove((kind, words, waiter))
                raise
        except ValueError as error:
            waiter.put(_failure(str(error)))
        return waiter


def errand_result(answer: Answer) -> GoTo.Result:
    """Convert the answer to an errand.

    Args:
        answer: From `gslts.ros.answers`.
    """
    x, y = answer.get("position_m") or (0.0, 0.0)
    distance_m = answer.get("distance_m")
    return GoTo.Result(
        status=answer["status"],
        reason=answer.get("reason", ""),
        frame_id=answer.get("frame_id", ""),
        position=Point(x=x, y=y),
        distance_m=math.nan if distance_m is None else distance_m,
        path_m=answer.get("path_m", 0.0),
    )


def _found_object(item: Answer) -> FoundObject:
    low, high = item["low_m"], item["high_m"]
    pose, size = Pose(), Vector3()
    pose.orientation.w = 1.0
    for axis, a, b in zip("xyz", low, high, strict=True):
        setattr(pose.position, axis, (a + b) / 2)
        setattr(size, axis, b - a)
    return FoundObject(center=pose, size=size, score=item["score"])


def _failure(reason: str) -> Answer:
    return {"status": "failed", "reason": reason}
