// The machine on which the figures were measured.
#pragma once

#include "tests/bench/rows.h"

namespace isomesh::bench {

// Says on standard error when others keep the machine busy: stages on two threads then take as long
// as on one, now and then.
void warn_when_busy();

// A row for each: processor, cores, memory, system, compiler, versions, load, date.
Json describe_machine();

}  // namespace isomesh::bench
