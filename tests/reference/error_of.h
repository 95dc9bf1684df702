// What a call that should throw says.
#pragma once

#include <string>

#include "base/error.h"

namespace fathom::reference {

// The message of the Error that `call` throws; "no error" where it throws none.
template <class Call>
std::string errorOf(const Call& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace fathom::reference
