"""Prints what live boards send, and keeps their models: python subscribe.py [tcp/127.0.0.1:7447]"""
import json, pathlib, sys, zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("connect/endpoints", json.dumps(sys.argv[1:] or ["tcp/127.0.0.1:7447"]))
with zenoh.open(config) as session, session.declare_subscriber("ossature/*/*/*") as boards:
    for sample in boards:
        told = json.loads(sample.attachment.to_string())
        print(sample.key_expr, told["number"], told["pair"], len(sample.payload), flush=True)
        if str(sample.key_expr).endswith("/model"):
            # Only a name and numbers: nothing from the network chooses a folder.
            site, board = str(sample.key_expr).split("/")[1:3]
            name = f"{site}-{board}-{int(told['run'], 16):014x}-{told['pair']:06d}.ply"
            pathlib.Path(name).write_bytes(sample.payload.to_bytes())
