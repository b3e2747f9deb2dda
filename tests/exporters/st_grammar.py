"""Grammar of the subset of Structured Text that the tests' interpreter understands."""

GRAMMAR = r"""
    start: "FUNCTION_BLOCK"i NAME block* body "END_FUNCTION_BLOCK"i

    block: SECTION CONSTANT? declaration* "END_VAR"i
    declaration: NAME ":" type [":=" initial] ";"
    type: TYPE -> scalar
        | NAME -> instance
        | "ARRAY"i "[" INTEGER ".." INTEGER "]" "OF"i TYPE -> array
    ?initial: literal
        | "[" literal ("," literal)* "]" -> values
    literal: [SIGN] (REAL | INTEGER | BOOLEAN | BITS)

    body: statement*
    statement: variable ":=" expression ";" -> assign
        | NAME "." NAME "[" expression "]" ":=" expression ";" -> hand
        | "IF"i branch ("ELSIF"i branch)* ["ELSE"i body] "END_IF"i ";" -> choose
        | "CASE"i expression "OF"i label+ ["ELSE"i body] "END_CASE"i ";" -> case
        | "FOR"i NAME ":=" expression "TO"i expression "DO"i body "END_FOR"i ";" -> count
        | "WHILE"i expression "DO"i body "END_WHILE"i ";" -> repeat
        | NAME ("." NAME)* "(" argument ("," argument)* ")" ";" -> invoke
    argument: NAME ":=" expression
    branch: expression "THEN"i body
    label: INTEGER ("," INTEGER)* ":" body

    ?expression: disjunction
    ?disjunction: exclusion | disjunction OR exclusion -> logic
    ?exclusion: conjunction | exclusion XOR conjunction -> logic
    ?conjunction: equality | conjunction AND equality -> logic
    ?equality: comparison | equality EQUALS comparison -> compare
    ?comparison: sum | comparison ORDER sum -> compare
    ?sum: term | sum SIGN term -> arithmetic
    ?term: unary | term FACTOR unary -> arithmetic
    ?unary: primary | "NOT"i unary -> negation | SIGN unary -> signed
    ?primary: REAL -> real | INTEGER -> integer | BOOLEAN -> boolean | BITS -> bits
        | "(" expression ")"
        | NAME "(" expression ("," expression)* ")" -> call
        | NAME ("." NAME)+ ["[" expression "]"] ["." BIT] -> member
        | variable
    variable: NAME ["[" expression "]"]

    SECTION.3: /VAR_IN_OUT\b|VAR_INPUT\b|VAR_OUTPUT\b|VAR\b/i
    CONSTANT.3: /CONSTANT\b/i
    TYPE.3: /BOOL\b|INT\b|DINT\b|LREAL\b|DWORD\b/i
    BOOLEAN.3: /TRUE\b|FALSE\b/i
    OR.3: /OR\b/i
    XOR.3: /XOR\b/i
    AND.3: /AND\b/i
    BIT.3: /%X[0-9]+/
    BITS.3: /16#[0-9A-Fa-f]+/
    REAL.2: /[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?/
    INTEGER: /[0-9]+/
    EQUALS.2: "=" | "<>"
    ORDER: "<=" | ">=" | "<" | ">"
    SIGN: "+" | "-"
    FACTOR: "*" | "/"
    NAME: /[A-Za-z](_?[A-Za-z0-9])*/
    COMMENT: /\(\*(.|\n)*?\*\)/
    %ignore COMMENT
    %ignore /[ \t\r\n]+/
"""
