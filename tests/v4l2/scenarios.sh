# What is done to `host capture` in the machine. Each scenario leaves in /out/NAME what was printed (`out.json`
# and `err`), the exit code (`code`), the second at which the driver was told to fail (`begin`) and that at which
# all was over (`end`), and the files that were written. What that has to be, tests/tests/v4l2.rs asserts outside.
# NAME.witness is what another program says when the same is done to it: the number behind our sentence.
#
# Camera 0 gives what node 1 is shown, camera 2 what node 3 is.

# A side-by-side frame, a single one, and rates at which they have timings that the driver takes.
BESIDE=1280x480@25
SINGLE=640x480@50

CALIBRATED="--calib calib.yaml"
OPTICS=$CALIBRATED

now() { cut -d ' ' -f 1 /proc/uptime; }

# Until a command succeeds, at most 60 s; without success the machine fails.
await() {
    local end=$(($(date +%s) + 60))
    until "$@"; do
        [ "$(date +%s)" -lt "$end" ] || { echo "waited in vain for: $*"; exit 1; }
        sleep 0.1
    done
}

# capture NAME ARGUMENT...
capture() {
    local name=$1 out=/out/$1 code=0
    shift
    echo "$(now) $name"
    mkdir "$out"
    # Options are words.
    timeout 60 host capture $OPTICS --resolution 8 --no-pictures --json --out "$out/models" \
        --record "$out/record" "$@" >"$out/out.json" 2>"$out/err" || code=$?
    now >"$out/end"
    echo $code >"$out/code"
}

# The same while something is done to camera 0 as soon as there is a model; ends by itself.
capture_while() {
    local name=$1 done=$2 capture
    capture "$name" --device /dev/video0 --format GREY &
    capture=$!
    await test -e "/out/$name/models/000001/model.ply"
    now >"/out/$name/begin"
    $done "$name"
    wait $capture
}

control() { v4l2-ctl -d "$1" -c "$2"; }

gives() {
    v4l2-ctl -d "$1" --set-fmt-video="$2" --stream-mmap --stream-skip=2 --stream-count=1 --stream-to=/tmp/frame >/dev/null 2>&1
    cmp -s /tmp/frame "$3"
}

# feed CAMERA WIDTHxHEIGHT@RATE FORMAT FILE: shows the file until the camera gives it. The driver keeps on showing
# what it was given last, so whoever feeds it is halted then, and takes neither time nor marks of the capture.
feed() {
    local camera=$1 node=$(($1 + 1)) width height rate format
    IFS=x@ read -r width height rate <<-SIZE
	$2
	SIZE
    format="width=$width,height=$height,pixelformat=$3"
    unfeed "$camera"
    for side in $camera $node; do
        v4l2-ctl -d "$side" --set-dv-bt-timings "cvt,width=$width,height=$height,fps=$rate,reduced-blanking=2" >/dev/null
    done
    v4l2-ctl -d $node --set-fmt-video-out="$format" --stream-out-mmap=8 --stream-loop --stream-from="$4" >/dev/null 2>&1 &
    echo $! >"/tmp/feeder-$camera"
    await gives "$camera" "$format" "$4"
    kill -STOP "$(cat "/tmp/feeder-$camera")"
}

unfeed() {
    [ -e "/tmp/feeder-$1" ] || return 0
    kill -KILL "$(cat "/tmp/feeder-$1")"
    wait "$(cat "/tmp/feeder-$1")"
    rm "/tmp/feeder-$1"
}

loop() { for camera in "$@"; do control "$camera" osd_text_mode=2,loop_video=1; done; }

loop 0 2
host list-devices --json >/out/devices.json

# Two cameras, and one whose bytes are of the left and the right eye in turn.
feed 0 $SINGLE GREY left.GREY
feed 2 $SINGLE GREY right.GREY
capture two --device /dev/video0 --device /dev/video2 --format GREY --frames 2
unfeed 2
feed 0 $SINGLE YUYV interleaved
capture interleaved --device /dev/video0 --format YUYV --layout interleaved --frames 1

# Both eyes in one frame, in every format; GREY is the last, and stays.
for format in YUYV UYVY NV12 "Y10 " "Y16 "; do
    feed 0 $BESIDE "$format" "${format% }"
    capture "${format% }" --device /dev/video0 --format "${format% }" --frames 1
done
feed 0 $BESIDE GREY GREY
capture GREY --device /dev/video0 --format GREY --frames 4

# Refused before anything is sent.
capture no-such-format --device /dev/video0 --format MJPG
capture no-such-view --device /dev/video0 --format GREY --size 1024x400
capture no-capture --device /dev/video1
capture no-device --device /dev/video9
capture no-video --device /dev/null
v4l2-ctl -d 0 --stream-mmap >/dev/null 2>&1 &
second=$!
sleep 1
capture busy --device /dev/video0 --format GREY
v4l2-ctl -d 0 --set-fmt-video=pixelformat=YUYV >/out/busy.witness 2>&1
kill -KILL $second
wait $second
for request in reqbufs qbuf streamon; do
    control 0 inject_vidioc_${request}_error=1
    capture $request --device /dev/video0 --format GREY
done
control 0 inject_vidioc_streamon_error=1
v4l2-ctl -d 0 --stream-mmap --stream-count=1 >/out/streamon.witness 2>&1
# Without its scaler the driver takes no other size than its source's, and says so when it has been set.
OPTICS="--focal 300 --baseline 60"
control 0 enable_capture_scaler=0,enable_capture_cropping=0,enable_capture_composing=0
capture adjusted --device /dev/video0 --format GREY --size 1024x400
control 0 enable_capture_scaler=1,enable_capture_cropping=1,enable_capture_composing=1
OPTICS=$CALIBRATED

# A camera that gives nothing, one that gives nothing for a while, and one that breaks.
control 0 percentage_of_dropped_buffers=100
capture silent --device /dev/video0 --format GREY
control 0 percentage_of_dropped_buffers=0

models() { ls "/out/$1/models" | wc -l; }
more_models() { [ "$(models "$1")" -gt "$2" ]; }

stall() {
    control 0 inject_v4l2_buf_flag_error=1
    sleep 1
    control 0 percentage_of_dropped_buffers=100
    sleep 3
    control 0 percentage_of_dropped_buffers=0
    await more_models "$1" "$(($(models "$1") + 1))"
    kill -INT "$(pidof host)"
}
capture_while stalled stall

# The driver's output breaks with its input, and has to be fed anew.
fail() { control 0 inject_fatal_streaming_error=1; }
capture_while failed fail
v4l2-ctl -d 0 --stream-mmap >/out/failed.witness 2>&1 &
sleep 1
fail
wait $!
feed 0 $BESIDE GREY GREY

# The camera is back when the last program has let go of it; the one that feeds it has not.
disconnect() { control 0 disconnect=1; }
capture_while disconnected disconnect
capture gone --device /dev/video0 --format GREY
cat /dev/video0 >/out/gone.witness 2>&1
feed 0 $BESIDE GREY GREY

# The driver lets go of its cameras, and they come back as nodes 2 to 5, since 0 and 1 are held. The host sleeps until
# its camera shows something again. A pair or two may be under way when it goes.
replug() {
    exec 9<>/dev/video0
    echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind
    await grep -q "waiting for it" "/out/$1/err"
    now >"/out/$1/told"
    kill -STOP "$(pidof host)"
    models "$1" >"/out/$1/before"
    echo vivid.0 >/sys/bus/platform/drivers/vivid/bind
    loop 2 4
    feed 2 $BESIDE GREY GREY
    kill -CONT "$(pidof host)"
    await more_models "$1" "$(($(cat "/out/$1/before") + 3))"
    kill -INT "$(pidof host)"
}
OPTICS="$CALIBRATED --wait 60"
capture_while replugged replug

echo "$(now) end"
