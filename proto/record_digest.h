// The digest at the end of a stored record. It finds wrong bytes that leave valid JSON, such as in
// the name of a member, which would otherwise get its default. Thread safe.
#pragma once

#include <string>
#include <string_view>

namespace isomesh {

// Adds the digest as the last member of a JSON object with members.
std::string with_digest(std::string json);

// The object without its digest. Records that an older version wrote or changed have none, and stay
// as they are.
// Throws Error kInternal if the record is not the one that its digest was made of.
std::string without_digest(std::string_view record);

}  // namespace isomesh
