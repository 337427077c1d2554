"""Steps of all sensors: joined tables, ranking, shortlist."""


rule tables:
    input:
        **{name: of_each_sensor(name) for name in OF_SENSOR},
        **ADDED_TABLES,
    output:
        **as_files(*sorted({*OF_SENSOR, *ADDED_TABLES})),
        datapackage=RESULTS + "/tables/datapackage.json",
    log:
        LOGS + "/tables.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.5, time=1, time_of_each=0.005)),
    params:
        software=plan.describe_software(),
        csv=[name for name in TABLES if plan.writes_csv(name)],
        parts=[name for name in TABLES if plan.has_parts(name)],
        code=plan.code("tables"),
    script:
        "../scripts/tables.py"


rule files:
    input:
        recordings=table("recordings"),
        failures=table("failures"),
    output:
        **as_files("files"),
    log:
        LOGS + "/files.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.1, time=1, time_of_each=0.1)),
    params:
        csv=plan.run.tables.csv,
        files=plan.files(),
        code=plan.code("files"),
    script:
        "../scripts/files.py"


rule ranking:
    input:
        **{name: table(name) for name in references("limits")},
        error_budget=table("error_budget"),
        backtest=table("backtest"),
        recordings=table("recordings"),
        doubts=table("doubts"),
        parameters=table("parameters"),
    output:
        **as_files("ranking", "next_steps"),
    log:
        LOGS + "/ranking.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.1, time=1, time_of_each=0.01)),
    params:
        csv=plan.run.tables.csv,
        settings=plan.ranking_settings(),
        code=plan.code("ranking"),
    script:
        "../scripts/ranking.py"


rule shortlist:
    input:
        recordings=table("recordings"),
        parameters=table("parameters"),
        ranking=table("ranking"),
    output:
        **as_files("shortlist"),
    log:
        LOGS + "/shortlist.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.2, time=3, time_of_each=0.01)),
    params:
        csv=plan.run.tables.csv,
        settings=plan.ranking_settings(),
        catalogue=plan.catalogue(
            "price_class", "sold", "temperature_range", "rate", "mass", "power"
        ),
        code=plan.code("shortlist"),
    script:
        "../scripts/shortlist.py"


rule repeatability:
    input:
        biases=table("fixed_bias"),
        recordings=table("recordings"),
    output:
        **as_files("repeatability"),
    log:
        LOGS + "/repeatability.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, memory_of_each=0.1, time=1, time_of_each=0.01)),
    params:
        csv=plan.run.tables.csv,
        settings=plan.settings("datasheet"),
        catalogue=plan.catalogue(),
        code=plan.code("repeatability"),
    script:
        "../scripts/repeatability.py"


rule catalogue:
    output:
        **as_files("catalogue", "coverage", "coverage_by_vendor"),
    log:
        LOGS + "/catalogue.log",
    group:
        "comparison"
    resources:
        **cost(Cost(memory=300, time=1)),
    params:
        csv=plan.run.tables.csv,
        catalogue=plan.catalogue("aliases", "grade", "technology", "sold"),
        code=plan.code("catalogue"),
    script:
        "../scripts/catalogue.py"
