// The machine on which the figures were measured.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace isomesh::bench {

int processors();

// Says on standard error when others keep the machine busy: stages on two threads then take as long
// as on one, now and then.
void warn_when_busy();

// Name and value: processor, cores, memory, system, compiler, versions, load, date.
std::vector<std::pair<std::string, std::string>> describe_machine();

}  // namespace isomesh::bench
