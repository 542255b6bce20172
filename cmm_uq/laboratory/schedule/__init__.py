"""Many jobs without anybody at the keyboard: folders found, locked, run one after another or in processes, messages sent.

It computes and decides nothing: what reports a job, what is due and where the state is kept come from the command.
"""
