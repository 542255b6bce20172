"""What the fourth study is, and what its page says of it."""

from __future__ import annotations

from benchmarks.fourth.cases import MANY, case
from benchmarks.third.page import SAID
from benchmarks.third.running import Generator

DONE = """\
### What was done

`python -m benchmarks.third.study FOLDER --generator fourth --seed {seed} --truth APART` with `--make` makes and seals the
cases and asks the oracles, with `--run` diagnoses them without the truth, and with `--tally` counts. Equations of the machine,
forms and readings (`benchmarks/fourth/`) are written anew and share no code with the package; oracles and counting are the
third study's, but that the oracle of the catalogue looks for every effect that is hidden.

- **Recordings**: as in the second and third study; besides runs along two or three axes with straightnesses, and a laser
  along three axes and four diagonals; *real* are the bars of the DEA Iota 1102, and its axes at the targets of its laser runs,
  with what they left, dealt anew, as noise. Columns are there or not; the noise is stated in half, of these one in five wrong
  by a factor of two; rows stand in any order in three of ten; of one in seven, with an artefact, the model is a prediction.
- **Noise** of the sizes of the second study, drawn reading after reading.
- Chains are a tenth as long as those of a diagnosis, and the next measurement is left out.

√λ is the length of what shows over the noise.

| hidden | √λ | what |
| --- | --- | --- |
| dictionary | 6 to 40, evenly in its logarithm | each of the twelve forms as often, of places, time, temperatures, sides of \
approach; every effect of the second study's catalogue leaves half of it |
| other | 6 to 40 | stairs, a curve through nine heights, ringing, a fractal, pulses, a trapezium, a beat, a hill, an egg box |
| catalogue | 4.5 to 15 | one to three effects, the first of each of 25 families as often |
| squareness | 4.5 to 15 | one, two or three squarenesses; a job that names nothing |
| ratio | 4.5 to 20 | two scales or squarenesses as 1 : 2, or one to three of the six; likewise |
| real | | a form or an effect in real noise |

"""
MARKS = "<!-- written by benchmarks.fourth.cases -->", "<!-- end of the fourth -->"
FOURTH = Generator(case, sum(MANY.values()), whole=True, marks=MARKS, said=DONE + SAID[SAID.index("| of the oracle") :])
