#include "base/niceness.h"

#include <tuple>

#include <unistd.h>

namespace isomesh {

// On Linux of this thread alone. It is refused to nobody, and what it returns is no error.
void be_nicer(int by) { std::ignore = ::nice(by); }

}  // namespace isomesh
