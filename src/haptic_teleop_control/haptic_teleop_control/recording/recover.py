"""`haptic-teleop recover`: rewrites what is whole in a damaged recording into a new one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording.bag_files import open_storage
from haptic_teleop_control.recording.bag_folder import Bag, describe, open_bag
from haptic_teleop_control.recording.bag_metadata import offered_qos
from haptic_teleop_control.recording.expansion import Budget, Damaged, TooLarge, expand_message
from haptic_teleop_control.recording.mcap_records import MESSAGE_HEAD, Messages
from haptic_teleop_control.recording.mcap_scan import McapScan
from haptic_teleop_control.recording.writer import RecordingWriter

WHOLE, NOTHING, LOSSY = 0, 1, 3
STATUSES = """exit status:
  0  the recording was whole; the copy holds all of it
  3  something was lost; the copy holds the rest
  1  nothing could be recovered; no copy was written
  2  bad arguments: no recording there, or the output exists already

The recording itself is never changed."""


def recover(bag: Bag, output: Path) -> tuple[dict[str, int], list[str]]:
    """Copies all whole messages of ``bag`` (MCAP) to a new recording at ``output``.

    Returns the messages written by topic (empty: nothing was found and nothing written) and what is wrong
    with the recording, as sentences. Raises RecordingError when ``output`` exists or cannot be written.
    """
    writer: RecordingWriter | None = None
    counts: dict[str, int] = {}
    try:
        for file in bag.files:
            try:
                budget = Budget(file.stat().st_size)
                with open_storage(file, budget) as stream:
                    scan = McapScan(stream, budget)
                    for messages in scan:
                        if writer is None:
                            writer = RecordingWriter(output)
                            counts = writer.counts
                        _copy(scan, messages, writer, bag.per_message)
                    bag.take_from(file, scan)
            except Damaged as damage:
                bag.damage(f"{file}: {damage}")
            except OSError as error:
                bag.damage(f"{file}: it cannot be read ({error.strerror or error})")
        if writer is None:
            return {}, bag.problems
        bag.check_counts(counts)
        writer.describe(**{key: value for key, value in describe(bag).items() if value})
    finally:
        if writer is not None:
            writer.close()
    return counts, bag.problems


def main(argv: Sequence[str] | None = None) -> int:
    """The command; see ``--help``."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop recover",
        description="Copy what is intact in a recording whose writer was killed or whose file is damaged.",
        epilog=STATUSES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "bag", metavar="BAG", type=Path, help="the recording: a rosbag2 directory or an .mcap file"
    )
    parser.add_argument(
        "--output", metavar="DIR", type=Path, help="the new recording (default: BAG_recovered)"
    )
    arguments = parser.parse_args(argv)
    source: Path = arguments.bag
    output: Path = arguments.output or source.resolve().with_name(f"{source.resolve().stem}_recovered")
    if output.resolve().is_relative_to(source.resolve()):
        raise ConfigurationError(
            f"{output}: it lies inside the recording, which is not changed: name another"
        )
    if output.exists():
        raise ConfigurationError(
            f"{output}: it exists already and is not overwritten: name another with --output"
        )
    bag = open_bag(source)
    if bag.storage != "mcap":
        raise ConfigurationError(
            f"{source}: it is an SQLite3 recording: recover it with `sqlite3 FILE.db3 .recover`"
        )
    counts, problems = recover(bag, output)
    for problem in problems:
        print(problem, file=sys.stderr)
    if not counts:
        print(f"error: {source}: no whole message is left: there is nothing to recover", file=sys.stderr)
        return NOTHING
    topics = ", ".join(f"{topic} {count}" for topic, count in sorted(counts.items()))
    print(f"{output}: {sum(counts.values())} messages recovered ({topics})")
    return LOSSY if bag.lossy else WHOLE


def _copy(scan: McapScan, messages: Messages, writer: RecordingWriter, compressed: bool) -> None:
    data = memoryview(messages.data)
    for offset, size in zip(messages.offset.tolist(), messages.size.tolist(), strict=True):
        _, _, number, sequence, received, published = MESSAGE_HEAD.unpack_from(data, offset)
        channel = scan.channels.get(number)
        if channel is None:
            scan.problems.append(f"a message belongs to channel {number}, which the file does not describe")
            continue
        kind = scan.type_of(number) or "unknown"
        if channel.topic not in writer.counts:
            schema = scan.schemas.get(channel.schema_id)
            text = schema.data.decode(errors="replace") if schema and schema.encoding == "ros2msg" else None
            qos = offered_qos(channel.metadata.get("offered_qos_profiles", ""))
            writer.add_topic(channel.topic, kind, text, channel.metadata.get("topic_type_hash"), qos)
        message = data[offset + MESSAGE_HEAD.size : offset + size]
        if compressed:
            try:
                message = expand_message(bytes(message), scan.budget)
            except TooLarge as refusal:
                raise TooLarge(f"a message on {channel.topic} {refusal}") from None
            except Damaged as damage:
                scan.problems.append(f"a message on {channel.topic} is left out: {damage}")
                continue
        writer.write(channel.topic, kind, received, message, published, sequence)
