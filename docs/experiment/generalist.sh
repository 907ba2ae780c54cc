#!/bin/bash
# The seven trainings of the shipped generalist, one after the other; two of them were stopped by hand (Ctrl-C) where it says so.
set -e
python train.py --config-dir docs experiment=generalist mixture=spread scenario=spread_default \
    hydra.run.dir=runs/1                                                                # 3 400 000 steps
docs="python train.py --config-dir docs"
$docs experiment=generalist_finetune start_from=runs/1 hydra.run.dir=runs/2             # 1 300 000
most="mixture.kinds.large.share=6 mixture.kinds.hilly.share=2 mixture.kinds.small.share=1 mixture.kinds.single.share=0.5
    mixture.kinds.water.share=0.5 mixture.kinds.hazard.share=0.5 mixture.kinds.pair.share=0.25"
$docs experiment=generalist_further start_from=runs/2 $most mixture.kinds.ring.share=3 algorithm.learning_rate=1e-4 \
    algorithm.critic_first=0.08 hydra.run.dir=runs/3                                    #   900 000
$docs experiment=generalist_further start_from=runs/3 $most mixture.kinds.ring.share=4 total_frames=660_000 \
    hydra.run.dir=runs/4                                                                #   stopped at 541 000
$docs experiment=generalist_further start_from=runs/4 hydra.run.dir=runs/5              #   until 508 000
warp export runs/5 MEAN average=runs/2 trust=1 mode=deterministic
$docs experiment=generalist_distilled imitation.teacher=MEAN start_from=MEAN n_worlds=256 total_frames=400_000 \
    algorithm.critic_first=0.08 mixture.kinds.single.share=5 mixture.kinds.skirmish.share=0.5 \
    mixture.kinds.skirmish.teacher=MEAN hydra.run.dir=runs/6                            #   400 000
$docs experiment=generalist_distilled imitation.teacher=MEAN start_from=runs/6 hydra.run.dir=runs/7     # until 393 000
warp export runs/7/checkpoints/393216 FOLDER mode=deterministic
