#include "entropy/tables.hpp"

namespace meshtide {

constexpr LogisticTables MADE = detail::make_logistic_tables();
const LogisticTables LOGISTIC = MADE;

} // namespace meshtide
