#!/usr/bin/env python3
"""Render training frames: render.py OUT --hdri FOLDER [--scenes FOLDER] [--jobs 0:200]. See README.md.

Work that is there already is not done again: stop it at any time and start it anew.
"""
import argparse
import glob
import os
import subprocess
import sys
import threading

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))


def made_scenes(folder):
    from shared_scene import HELD_OUT
    found = sorted(os.path.dirname(p) for p in glob.glob(os.path.join(folder, '*', 'scene.xml')))
    return [f for f in found if os.path.basename(f) not in HELD_OUT]


def work(args, first, last):
    """Render jobs here, saying which before each, so that a crash can be told from an end."""
    import drjit as dr
    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    dr.set_thread_count(args.threads)
    import job
    scenes = made_scenes(args.scenes) if args.scenes else []
    for index in range(first, last):
        print(f'job {index}', flush=True)
        try:
            job.run(index, args.out, scenes, args.hdri, args.kind, args.samples, args.only_samples)
        except Exception as e:
            print(f'job {index}: skipped: {type(e).__name__}: {str(e).splitlines()[0] if str(e) else ""}', flush=True)
        dr.flush_malloc_cache()


def supervise(args, first, last):
    """Run jobs in child processes of a few each; one that dies or hangs costs the job it was at."""
    while first < last:
        end = min(first + args.batch, last)
        command = [sys.executable, os.path.abspath(__file__), *sys.argv[1:], '--worker', f'{first}:{end}']
        at = first
        child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        clock = threading.Timer(args.limit * args.batch, child.kill)
        clock.start()
        for line in child.stdout:
            if line.startswith('job ') and ':' not in line:
                at = int(line.split()[1])
            else:
                print(line, end='', flush=True)
        code = child.wait()
        clock.cancel()
        if code:
            print(f'job {at}: skipped: the renderer ended with {code}', flush=True)
        first = end if code == 0 else at + 1


def span(text):
    a, b = text.split(':')
    return int(a), int(b)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument('out')
    p.add_argument('--hdri', required=True, help='folder of *.hdr environments')
    p.add_argument('--scenes', default='', help='folder of NAME/scene.xml; none: random scenes alone')
    p.add_argument('--jobs', type=span, default=(0, 200), help='indices FIRST:END; three views each')
    p.add_argument('--kind', default='', help='random scenes of one kind alone: outdoors, studio, room, clutter, veil or pelt')
    p.add_argument('--samples', type=int, default=64, help='camera samples per pixel that are kept one by one; training takes some of them')
    p.add_argument('--only-samples', action='store_true', help='add files of samples to views that have a reference, and render nothing else')
    p.add_argument('--threads', type=int, default=os.cpu_count())
    p.add_argument('--batch', type=int, default=8, help='jobs per process')
    p.add_argument('--limit', type=int, default=600, help='seconds per job, averaged over a batch, before it is ended')
    p.add_argument('--worker', type=span, help=argparse.SUPPRESS)
    args = p.parse_args()
    work(args, *args.worker) if args.worker else supervise(args, *args.jobs)


if __name__ == '__main__':
    os.environ.setdefault('DRJIT_LIBLLVM_PATH', next(iter(glob.glob('/usr/lib/*/libLLVM-19.so')), ''))
    main()
