#include "server/volume/unusable.h"

#include <algorithm>
#include <utility>

namespace isomesh::volume {

void throw_unusable(const std::string& reason) { throw Error(ErrorCode::kUnusableVolume, reason); }

void throw_damaged() {
  throw_unusable("The stored volume is damaged. Upload it again, then repeat the request.");
}

void throw_overridable(NoteCode code, const std::string& reason) {
  throw Error(ErrorCode::kUnusableVolume, reason)
      .with_remedy({.overridable = std::string(describe(code).name)});
}

void throw_choice(const std::string& reason, std::vector<Choice> choices) {
  choices.resize(std::min(choices.size(), kMostChoices));
  throw Error(ErrorCode::kUnusableVolume, reason).with_remedy({.choices = std::move(choices)});
}

}  // namespace isomesh::volume
