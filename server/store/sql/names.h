// Names in SQL of the values that the tables contain, such as {job.queued}. For engines only.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::store {

// Replaces the names in a statement by their values, which is done when it is prepared. An
// empty JSON object stays. Throws Error kInternal for an unknown name.
std::string with_numbers(std::string_view sql);

}  // namespace isomesh::store
